"""How often 95 % intervals of frequencies hold after few poses, on robots of another engine.

    pytest -m slow -s tests/campaign/test_few_poses.py

FEW_SEED is the first seed, FEW how many robots (10). After one pose it is 0.88 to 0.96 of ten.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass

import msgspec
import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from planner.campaign.build import build
from planner.campaign.cell import Cell
from planner.campaign.config import CampaignConfig
from planner.campaign.low_fidelity import Recall, in_memory
from planner.campaign.measured_modes import from_modal
from planner.campaign.model import Model
from planner.campaign.state import CampaignState, Measurement
from planner.campaign.straightened import hits_unknown
from planner.robot.robot import Robot
from tests.support.counted_modes import NOT_COUNTED, counted, true_modes
from tests.support.fitted_cases import ARMS, COUNTED, Case, everyday, harder

FIRST, ROBOTS = int(os.environ.get("FEW_SEED", "6200")), int(os.environ.get("FEW", "10"))
COUNTS = 1, 2, 3, 4, 6
UNSEEN = 30


def models(case: Case, recall: Recall) -> Iterator[Model]:
    """The campaign's model after COUNTS poses."""
    robot = Robot.load(case.toml)
    low, high = np.rad2deg(np.clip(case.box_rad, robot.lower_rad, robot.upper_rad))
    config = msgspec.convert(
        {
            "robot": str(case.toml),
            "workspace": {"joints_deg": np.column_stack([low, high]).tolist()},
            "modes": {"count": COUNTED, "band_hz": list(case.band_hz)},
            "acquisition": {"candidates": 50},
        },
        CampaignConfig,
    )
    cell = Cell.load(case.toml, config)
    used = [
        Measurement(f"P{k}", tuple(np.rad2deg(q).tolist()), (), from_modal(pose.modal))
        for k, (q, pose) in enumerate(zip(case.q, case.measured, strict=True))
    ]
    frfs = {m.pose: frf for m, frf in zip(used, case.frfs, strict=True)}
    for n in COUNTS:
        state = CampaignState(measurements={m.pose: m for m in used[:n]})
        yield build(cell, state, hits_unknown(frfs), recall)


@dataclass(frozen=True, eq=False)
class Told:
    """Of frequencies (UNSEEN, modes): errors and sds of ln f."""

    off: np.ndarray
    sd: np.ndarray

    @classmethod
    def of(cls, model: Model, q: np.ndarray, true: list) -> "Told":
        """At q, where `true_modes` has found what is `true`."""
        f, sd = model.frequencies(q)
        hertz = np.array([counted(*one, row) for one, row in zip(true, f, strict=True)])
        return cls(np.log(f / hertz), sd / f)

    @property
    def held(self) -> float:
        """Share of the truths that 95 % intervals hold."""
        return float(np.mean(np.abs(self.off) <= 1.96 * self.sd))

    @property
    def percent(self) -> tuple[float, float]:
        """Medians of error and of sd in %."""
        return 100 * float(np.median(np.abs(self.off))), 100 * float(np.median(self.sd))

    @property
    def words(self) -> str:
        """Such as "0.92 (0.64, 1.19 %)"."""
        return f"{self.held:.2f} ({self.percent[0]:.2f}, {self.percent[1]:.2f} %)"


def told(case: Case, recall: Recall) -> list[Told]:
    """After COUNTS poses."""
    rng = np.random.default_rng(1)
    q = rng.uniform(*case.box_rad, (UNSEEN, case.q.shape[1]))
    true = [true_modes(case.truth, one, COUNTED + NOT_COUNTED) for one in q]
    return [Told.of(model, q, true) for model in models(case, recall)]


@pytest.mark.slow
@pytest.mark.timeout(14400)
def test_intervals_hold_from_the_second_pose_on(tmp_path):
    print(f"\nshare held (median error, median sd) after {COUNTS} poses")
    found = []
    for number in range(ROBOTS):
        arm, make = [*ARMS][number % len(ARMS)], (everyday, harder)[number // len(ARMS) % 2]
        case = make(arm, FIRST + number, tmp_path / str(number))
        with threadpool_limits(1):
            found.append(told(case, in_memory()))
        print(FIRST + number, arm, make.__name__, "; ".join(t.words for t in found[-1]), flush=True)
    held = np.array([[t.held for t in one] for one in found])
    print("all: " + "; ".join(f"{share:.3f}" for share in held.mean(axis=0)))
    assert np.all(held.mean(axis=0)[1:] >= 0.9)
