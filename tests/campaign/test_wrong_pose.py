"""Hits of another pose of the workspace, under a pose's name, after one to three measurements."""

import csv

import numpy as np
import pytest

from planner.campaign.asking import NewHits, asked_of
from planner.campaign.campaign import Campaign
from planner.campaign.log_conversion import from_modal
from planner.campaign.question import question
from planner.dataset.measure import MeasuredPose, measure
from planner.dataset.screened_files import Source
from planner.recording.folder import TABLE
from tests.support.generated_arms import BAND_HZ, Arm, make_generated_arm

ARMS = ((911, 4, 2), (912, 4, 3), (913, 5, 3), (914, 4, 2), (915, 5, 3))  # seed, joints, modes
POSES, PAIRS = 24, 40


def measured(arm: Arm, folder, poses: int = 3) -> Campaign:
    campaign = Campaign.new(folder / "campaign", arm.robot_toml, arm.campaign_toml)
    for number in range(poses):
        (pose,) = campaign.next()
        named = [(pose.pose, np.deg2rad(pose.joints_deg))]
        (report,) = campaign.import_paths((arm.record(folder / pose.pose, named, number),))
        assert report.question is None
    return campaign


def modes_at(arm: Arm, folder, q: np.ndarray) -> list:
    """Modes by the hits at each of the poses q (n, dof) in rad."""
    return [from_modal(one.modal) for one in measured_at(arm, folder, q)]


def measured_at(arm: Arm, folder, q: np.ndarray) -> list[MeasuredPose]:
    """What the hits at each of the poses q (n, dof) in rad give."""
    made = arm.record(folder / "others", [(f"W{i}", row) for i, row in enumerate(q)], 9)
    with open(made / TABLE, newline="") as file:
        rows = list(csv.DictReader(file))
    sources = {
        f"W{i}": tuple(Source(made / r["file"], r["file"], r["hit"], int(r["repeat"]))
                       for r in rows if r["pose"] == f"W{i}")
        for i in range(len(q))
    }  # fmt: skip
    return [measure(own, BAND_HZ) for own in sources.values()]


def judged(folder, seed: int, joints: int, modes: int) -> tuple[bool, int, int]:
    """Whether the simulation fits, and how often was asked of wrong poses and of right ones."""
    arm = make_generated_arm(folder, seed, joints, modes)
    campaign = measured(arm, folder)
    rng = np.random.default_rng(seed + 2)
    q = rng.uniform(*arm.box_rad.T, (POSES, joints))
    found = modes_at(arm, folder, q)

    def asked(at: int, hits: int) -> bool:
        angles = tuple(np.rad2deg(q[at]).tolist())
        return question(campaign.model, campaign.state, "X", angles, found[hits]) is not None

    pairs = [rng.choice(POSES, 2, replace=False).tolist() for _ in range(PAIRS)]
    wrong = sum(asked(stated, true) for stated, true in pairs)
    return campaign.model.low.taught, wrong, sum(asked(i, i) for i in range(POSES))


@pytest.mark.parametrize("poses", [1, 2])
def test_another_pose_is_asked_about_before_three_are_measured(tmp_path, poses):
    arm = make_generated_arm(tmp_path, 922, 4, 3)
    campaign = measured(arm, tmp_path, poses)
    q = np.random.default_rng(924).uniform(*arm.box_rad.T, (6, 4))
    first = np.deg2rad(campaign.state.used[0].joints_deg)
    *found, again = measured_at(arm, tmp_path, np.vstack([q, first]))

    def asked(at: int, one: MeasuredPose):
        angles = tuple(np.rad2deg(q[at]).tolist())
        new = NewHits("X", angles, one.frf, from_modal(one.modal))
        return asked_of(campaign.model, campaign.state, new)

    assert not any(asked(i, found[i]) for i in range(6))
    repeated = [asked(i, again) for i in range(6)]
    assert [one and one.fits for one in repeated] == ["P001"] * 6
    assert all("repeat the modes measured at P001" in one.text for one in repeated if one)
    wrong = [asked(i, found[j]) is not None for i in range(6) for j in range(6) if i != j]
    assert np.mean(wrong) >= (0.7 if poses == 1 else 0.9)


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_another_pose_is_asked_about(tmp_path):
    found = [judged(tmp_path / str(seed), seed, *size) for seed, *size in ARMS]
    for (seed, joints, modes), (taught, wrong, false) in zip(ARMS, found, strict=True):
        print(f"arm {seed}, {joints} joints, {modes} modes, simulation fits: {taught}; asked of "
              f"{wrong} of {PAIRS} wrong poses and {false} of {POSES} right ones")  # fmt: skip
    assert sum(wrong for _, wrong, _ in found) >= 0.95 * PAIRS * len(ARMS)
    assert sum(false for *_, false in found) <= 0.02 * POSES * len(ARMS)
