"""Small arms of random make, without meshes, and hands that hit them a little askew."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.proof import descriptions
from planner.proof.deviation import Deviation
from planner.proof.fault_injection import InjectedFaults
from planner.proof.load import load_truth
from planner.proof.measurement_errors import MeasurementErrors
from planner.proof.model import Truth
from planner.proof.scene import log_uniform
from tests.support.outside import HAMMER
from tests.support.struck_poses import record_by_hand

BAND_HZ = (3.0, 60.0)
AXES = ((0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0))
BOX_DEG = ((-60, 60), (-80, -10), (10, 90), (-90, 90), (-60, 60), (-90, 90))
ASKEW = MeasurementErrors(angle_deg=2.0, readback_deg=0.005)


@dataclass(frozen=True)
class Arm:
    """Files of a robot and a campaign, and what its true robot is like."""

    robot_toml: Path
    campaign_toml: Path
    truth: Truth
    seed: int

    @property
    def box_rad(self) -> np.ndarray:
        """Joint ranges (dof, 2) of the workspace."""
        return np.deg2rad(BOX_DEG[: len(self.truth.joint_names)])

    def record(self, folder: Path, poses: Sequence[tuple[str, np.ndarray]], number: int) -> Path:
        """Two hits an axis at each pose."""
        stated = [(name, np.round(np.rad2deg(q), 4)) for name, q in poses]
        axes = [f"+{axis}" for axis in "xyz" for _ in range(2)]
        rng = np.random.default_rng([self.seed, number])
        record_by_hand(folder, self.truth, InjectedFaults(Deviation()), ASKEW, stated, axes, HAMMER,
                       rng)  # fmt: skip
        return folder


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
    return Arm(robot, campaign, load_truth(robot, off), seed)


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
