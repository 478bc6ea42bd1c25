"""Two concealed effects at once are both named more often than not: pytest -m slow -s (minutes).

STUDY_SEEDS (10) and STUDY_FIRST (701) choose the cases.
"""

import json
import os
import subprocess
import time

import pytest

from planner import program
from planner.truth.arms import ARMS
from planner.truth.cases import make_case

SEEDS, FIRST = int(os.environ.get("STUDY_SEEDS", "10")), int(os.environ.get("STUDY_FIRST", "701"))
EXPECTED = 0.7


@pytest.mark.slow
@pytest.mark.timeout(0)
def test_both_of_two_effects_are_named(tmp_path):
    right = 0
    for seed in range(FIRST, FIRST + SEEDS):
        case = make_case("pair", sorted(ARMS)[seed % len(ARMS)], seed, tmp_path / str(seed))
        command = program.command(
            "diagnose", str(case.recordings), "--robot", str(case.robot_toml), "--json"
        )
        started = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        seconds = time.perf_counter() - started
        there = {(e["effect"], e["at"]) for e in json.loads(case.answer)["effects"]}
        said = {(f["effect"], f["at"]) for f in json.loads(done.stdout)["findings"]}
        right += said == there
        print(f"{seed} {seconds:.0f} s: {sorted(there)}, said {sorted(said, key=str)}", flush=True)
    print(f"{right} of {SEEDS} right")
    assert right >= EXPECTED * SEEDS
