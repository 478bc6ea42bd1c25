"""What more sensors tell: four along the arm against the tool's alone, on the same hits.

    pytest -m slow -s tests/measurement/test_more_sensors.py

prints how often effect and place are named, over the number of hits. It takes hours and resumes:
SENSOR_PROOF is the folder that keeps answers, SENSOR_CASES how many cases of each kind (60),
SENSOR_PARTS what is asked of each ("1x1 4x1 1x2 4x2 1x4 4x4": sensors x poses), SENSOR_SEED the
first seed. What a folder holds is printed by

    python -m tests.measurement.test_more_sensors FOLDER
"""

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from planner.diagnosis.diagnose import PRIORS
from planner.dynamics.simulation import Simulation
from planner.effects.table import EffectLibrary, diagnosed
from planner.proof.score import Share, share
from planner.robot.robot import Robot
from tests.support.arm_with_points import write_arm
from tests.support.sensor_cases import KINDS, Said, answers, concealed, held

FIRST = 9001
TOLD = 20.0  # nats: what tells less of an effect is not counted against a diagnosis
MORE_OFTEN = 0.10  # by which four sensors name effect and place more often, or hits are halved


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_concealed_has_a_name(kind: str, tmp_path: Path) -> None:
    simulation = Simulation(Robot.load(write_arm(tmp_path)))
    named = {e.name for e in EffectLibrary.of(simulation, PRIORS, diagnosed(simulation)).effects}
    places = {concealed(kind, np.random.default_rng(seed)).place for seed in range(6)}
    assert places <= named
    assert len(places) > 1 or kind == "base"


@pytest.mark.slow
@pytest.mark.timeout(86400)
def test_four_sensors_name_more_or_take_half_the_hits(tmp_path: Path, capsys) -> None:
    folder = Path(os.environ.get("SENSOR_PROOF", tmp_path))
    each = int(os.environ.get("SENSOR_CASES", "60"))
    text = os.environ.get("SENSOR_PARTS", "1x1 4x1 1x2 4x2 1x4 4x4")
    parts = [(int(a), int(b)) for a, b in (part.split("x") for part in text.split())]
    folder.mkdir(parents=True, exist_ok=True)
    first = int(os.environ.get("SENSOR_SEED", str(FIRST)))
    found = list(answers(folder, each, first, parts))
    with capsys.disabled():
        print("\n" + table(found))
    named = {at: of(found, *at).share or 0.0 for at in {(s.sensors, s.hits) for s in found}}
    one, four = ({hits: p for (n, hits), p in named.items() if n == k} for k in (1, 4))
    better = all(four[h] >= one[h] + MORE_OFTEN for h in one if h in four)
    halved = any(2 * h <= most and four[h] >= one[most] for h in four for most in one)
    assert better or halved


def of(found: list[Said], sensors: int, hits: int, kind: str = "") -> Share:
    """Of all that were so heard and can be told, how many were named at their place."""
    some = [s for s in found if (s.sensors, s.hits) == (sensors, hits) and s.nats > TOLD]
    return share([s.named for s in some if s.case.startswith(kind)])


def table(found: list[Said]) -> str:
    """Shares and their 95 % intervals, by kind, and by how much the tool's sensor can tell."""
    bounds = [TOLD, *(float(b) for b in np.quantile([s.nats for s in found], [1 / 3, 2 / 3]))]
    lines = [
        f"sensors, hits: named and placed of those told by more than {TOLD:g} nats (Wilson 95 %); "
        + ", ".join(KINDS)
        + f"; from {bounds[0]:.0f}, {bounds[1]:.3g}, {bounds[2]:.3g} nats on"
    ]
    for sensors, hits in sorted({(s.sensors, s.hits) for s in found}):
        all_, (low, high) = of(found, sensors, hits), of(found, sensors, hits).interval95
        kinds = [of(found, sensors, hits, kind) for kind in KINDS]
        some = [s for s in found if (s.sensors, s.hits) == (sensors, hits)]
        size = [
            share([s.named for s in some if a < s.nats <= b])
            for a, b in zip(bounds, [*bounds[1:], np.inf], strict=True)
        ]
        lines.append(
            f"{sensors}, {hits:3d}: {all_.right} of {all_.of} ({low:.2f} to {high:.2f}); "
            + ", ".join(f"{k.right}/{k.of}" for k in kinds)
            + "; "
            + ", ".join(f"{k.right}/{k.of}" for k in size)
            + f"; in a set of two {share([s.in_set for s in some]).right}"
            + f", names beside {sum(s.others for s in some)}"
            + f", not told and named {sum(bool(s.said) for s in some if s.nats <= TOLD)}"
            + f", {sum(s.cpu_s for s in some) / len(some):.0f} s CPU"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    print(table(held(Path(sys.argv[1]))))
