"""Concealed faults of the measuring chain are never called physics: pytest -m slow -s (minutes).

STUDY_SEEDS (5 of each kind) and STUDY_FIRST (601) choose the cases.
"""

import json
import os
import subprocess
from pathlib import Path

import pytest

from planner import program
from planner.truth.arms import ARMS
from planner.truth.cases import make_case
from planner.truth.mishaps import ARTEFACTS

SEEDS, FIRST = int(os.environ.get("STUDY_SEEDS", "5")), int(os.environ.get("STUDY_FIRST", "601"))


def diagnosed(folder: Path) -> dict:
    robot, recordings = folder / "robot" / "robot.toml", folder / "recordings"
    command = program.command("diagnose", str(recordings), "--robot", str(robot), "--json")
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


@pytest.mark.slow
@pytest.mark.timeout(0)
def test_an_artefact_is_found_and_nothing_beside_it(tmp_path):
    found, made_up, count = 0, [], 0
    for number, kind in enumerate(ARTEFACTS):
        for seed in range(FIRST + SEEDS * number, FIRST + SEEDS * (number + 1)):
            folder = tmp_path / str(seed)
            make_case(kind, sorted(ARMS)[seed % len(ARMS)], seed, folder)
            said = [(f["effect"], f["probability"]) for f in diagnosed(folder)["findings"]]
            print(kind, seed, said, flush=True)
            count += 1
            found += kind in [effect for effect, _ in said]
            made_up += [effect for effect, _ in said if effect not in (*ARTEFACTS, "unknown")]
    print(f"{found} of {count} found; beside them, made up: {made_up}")
    assert not made_up
    assert found >= 0.9 * count
