"""A campaign learns from every sensor that listened, as identify and diagnose do."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.campaign.campaign import Campaign
from planner.proof.deviation import Deviation, soft_floor
from planner.proof.fault_injection import InjectedFaults
from planner.proof.measurement_errors import EVERYDAY
from planner.proof.model import Truth
from tests.support.arm_with_points import poses, record, write_arm

PLAN = "[workspace]\njoints_deg = [[-60, 60], [-40, 30], [20, 100], [-50, 50]]\n"
PLAN += "[modes]\ncount = 3\nband_hz = [4.0, 80.0]\n"
SOFT_FLOOR = soft_floor(1.1e6, 1.1e6)


def measured(folder: Path) -> tuple[Campaign, Truth]:
    """Hit once along each axis at three poses, by hand, on a floor that gives way."""
    toml = write_arm(folder / "robot")
    (folder / "campaign.toml").write_text(PLAN)
    injected = InjectedFaults(Deviation(31, 0.12, 0.3, 0.05, 0.006, extra=SOFT_FLOOR))
    sensors = ("sensor", "shoulder", "elbow"), ("sensor", "foot"), ("sensor", "shoulder", "elbow")
    where = zip(poses(3, 77), sensors, strict=True)
    stays = [(f"P{i}", q, "tcp", s) for i, (q, s) in enumerate(where)]
    hand = replace(EVERYDAY, angle_deg=2.0, offset_m=0.005)
    truth = record(folder / "hits", toml, stays, injected, hand, seed=5)
    campaign = Campaign.new(folder / "new", toml, folder / "campaign.toml")
    campaign.import_paths((folder / "hits",))
    return campaign, truth


def worst_percent(campaign: Campaign, truth: Truth) -> float:
    """Root mean square error of the worst mode at poses never hit."""
    unseen = poses(12, 5)
    true_hz = np.array([truth.modes(q, 3)[0] for q in unseen])
    off = np.log(campaign.model.predict(unseen).frequency_hz / true_hz)
    return float(100 * np.sqrt(np.mean(off**2, axis=0)).max())


@pytest.mark.slow
def test_the_simulation_explains_what_all_sensors_heard(tmp_path: Path) -> None:
    campaign, truth = measured(tmp_path)
    model = campaign.model
    assert model.low.is_identified
    assert "The base gives way (stiffness about x" in model.remarks[0]
    assert worst_percent(campaign, truth) < 0.1
    assert model.frequency_sd_percent.max() < 0.3
