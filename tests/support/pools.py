"""Recorded pools of a robot whose truth comes from another engine."""

from pathlib import Path

import numpy as np

from planner.proof import descriptions
from planner.proof.deviation import Deviation
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.proof.recordings import record_poses
from tests.support.robots import BAND_HZ, JOINTS_DEG, make_arm

HAMMER = Hammer(peak_n=60.0, duration_s=0.004, record_s=2.0, sampling_rate_hz=640.0)


def make_pool(root: Path, poses: int, seed: int) -> tuple[Path, Path, Path]:
    """Recordings of poses in the joint box, robot.toml, campaign.toml."""
    robot = make_arm(root / "robot")
    off = Deviation(seed=seed, stiffness=0.15, damping=0.1, inertia=0.04, com_m=0.003)
    truth = load_truth(robot, off)
    low, high = np.deg2rad(np.array(JOINTS_DEG, dtype=float)).T
    q = np.random.default_rng(seed).uniform(low, high, (poses, 6))
    named = [(f"P{i:03d}", row) for i, row in enumerate(q)]
    recordings = record_poses(truth, named, root / "hits", repeats=1, hammer=HAMMER, seed=seed)
    campaign = root / "campaign.toml"
    campaign.write_text(descriptions.campaign(JOINTS_DEG, 3, BAND_HZ, 'name = "variance"\n'))
    return recordings, robot, campaign
