"""Small arms of random make, without meshes, and hands that hit them a little askew."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.proof import descriptions
from planner.proof.deviation import Deviation
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.proof.model import Truth
from planner.proof.recordings import record_poses
from planner.proof.scene import log_uniform

HAMMER = Hammer(peak_n=60.0, duration_s=0.004, record_s=2.0, sampling_rate_hz=640.0)
BAND_HZ = (3.0, 60.0)
AXES = ((0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0))
BOX_DEG = ((-60, 60), (-80, -10), (10, 90), (-90, 90), (-60, 60), (-90, 90))
TILT_RAD = np.deg2rad(2.0)  # sd of a hit's direction about each of two axes across it


@dataclass
class Tilting:
    """A true robot whose hits are tilted by chance."""

    truth: Truth
    rng: np.random.Generator

    @property
    def joint_names(self) -> tuple[str, ...]:
        return self.truth.joint_names

    @property
    def slides(self) -> tuple[bool, ...]:
        return self.truth.slides

    @property
    def description(self) -> str:
        return self.truth.description

    def respond(self, q: np.ndarray, force_n: np.ndarray, axis: int, step_s: float) -> np.ndarray:
        found = self.truth.respond(q, force_n, axis, step_s)
        for across in (1, 2):
            tilt = self.rng.normal(0, TILT_RAD)
            found = found + tilt * self.truth.respond(q, force_n, (axis + across) % 3, step_s)
        return found


@dataclass(frozen=True)
class Arm:
    """Files of a robot and a campaign, and what its true robot is like."""

    robot_toml: Path
    campaign_toml: Path
    truth: Tilting
    seed: int

    @property
    def box_rad(self) -> np.ndarray:
        """Joint ranges (dof, 2) of the workspace."""
        return np.deg2rad(BOX_DEG[: len(self.truth.joint_names)])

    def record(self, folder: Path, poses: Sequence[tuple[str, np.ndarray]], number: int) -> Path:
        """Two hits an axis at each pose."""
        seed = 10 * self.seed + number
        return record_poses(self.truth, poses, folder, repeats=2, hammer=HAMMER, seed=seed)


def make_generated_arm(folder: Path, seed: int, joints: int, modes: int) -> Arm:
    """Write an arm's robot and campaign folder; its springs are off by some 15 %."""
    rng = np.random.default_rng(seed)
    urdf = _urdf(rng, joints)
    lines = descriptions.head("generated", "arm.urdf", "tcp", "tcp", BAND_HZ)
    for number, axis in enumerate(AXES[:joints], 1):
        stiffness = log_uniform(rng, 2e4, 8e4) / (5 if number > 3 else 1)
        lines.append(descriptions.compliance(f"joint_{number}", axis, stiffness, 4e-4))
    robot = descriptions.write_robot(folder / "robot", "arm.urdf", urdf, lines)
    campaign = folder / "campaign.toml"
    more = "candidates = 60\n"
    campaign.write_text(descriptions.campaign(BOX_DEG[:joints], modes, BAND_HZ, more))
    off = Deviation(seed=seed + 1, stiffness=0.15, damping=0.1, inertia=0.04, com_m=0.003)
    truth = Tilting(load_truth(robot, off), np.random.default_rng(seed))
    return Arm(robot, campaign, truth, seed)


def _urdf(rng: np.random.Generator, joints: int) -> str:
    masses = np.sort(rng.uniform(1.5, 12.0, joints))[::-1]
    parts = [descriptions.link("link_0")]
    for i, (mass, axis) in enumerate(zip(masses, AXES, strict=False), 1):
        x, z = (0.0, 0.25) if i == 1 else (rng.uniform(0, 0.12), rng.uniform(0.05, 0.2))
        if i > 2:
            x, z = rng.uniform(0.25, 0.5), rng.uniform(-0.03, 0.03)
        centre = np.round([rng.uniform(0.08, 0.2), *rng.uniform(-0.03, 0.03, 2)], 3)
        moments = np.round(mass * np.array([0.008, 0.02, 0.02]), 5)
        names, place = (f"joint_{i}", f"link_{i - 1}", f"link_{i}"), np.round((x, 0, z), 3)
        inertial = descriptions.inertial(np.round(mass, 3), centre, moments)
        parts.append(descriptions.link(f"link_{i}", inertial))
        parts.append(descriptions.joint(*names, place, axis, (-2.9, 2.9)))
    parts.append(descriptions.frame("tcp", f"link_{joints}", (0.18, 0.03, 0.05)))
    return descriptions.urdf("generated", parts)
