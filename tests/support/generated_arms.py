"""Small arms of random make, without meshes, and hands that hit them a little askew."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.proof.deviation import Deviation
from planner.proof.hits import Hammer, record_poses
from planner.proof.load import load_truth
from planner.proof.model import Truth

HAMMER = Hammer(peak_n=60.0, duration_s=0.004, record_s=2.0, sampling_rate_hz=640.0)
BAND_HZ = (3.0, 60.0)
AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
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
    (folder / "robot").mkdir(parents=True)
    (folder / "robot" / "arm.urdf").write_text(_urdf(rng, joints))
    lines = [
        'name = "generated"', 'urdf = "arm.urdf"', 'tcp_frame = "tcp"', 'sensor_frame = "tcp"',
        f"band_hz = {list(BAND_HZ)}",
    ]  # fmt: skip
    for number, axis in enumerate(AXES[:joints], 1):
        stiffness = float(np.exp(rng.uniform(np.log(2e4), np.log(8e4)))) / (5 if number > 3 else 1)
        lines += [
            "[[compliance]]",
            f'joint = "joint_{number}"',
            f"axis = [{', '.join(axis.split())}]",
        ]
        lines += [f"stiffness = {stiffness}", f"damping = {4e-4 * stiffness}"]
    robot = folder / "robot" / "robot.toml"
    robot.write_text("\n".join(lines) + "\n")
    campaign = folder / "campaign.toml"
    campaign.write_text(
        f"[workspace]\njoints_deg = {[list(pair) for pair in BOX_DEG[:joints]]}\n"
        f"[modes]\ncount = {modes}\nband_hz = {list(BAND_HZ)}\n[acquisition]\ncandidates = 60\n"
    )
    off = Deviation(seed=seed + 1, stiffness=0.15, damping=0.1, inertia=0.04, com_m=0.003)
    truth = Tilting(load_truth(robot, off), np.random.default_rng(seed))
    return Arm(robot, campaign, truth, seed)


def _urdf(rng: np.random.Generator, joints: int) -> str:
    masses = np.sort(rng.uniform(1.5, 12.0, joints))[::-1]
    text = ['<robot name="generated"><link name="link_0"/>']
    for i in range(1, joints + 1):
        x, z = (0.0, 0.25) if i == 1 else (rng.uniform(0, 0.12), rng.uniform(0.05, 0.2))
        if i > 2:
            x, z = rng.uniform(0.25, 0.5), rng.uniform(-0.03, 0.03)
        mass = masses[i - 1]
        centre = np.round([rng.uniform(0.08, 0.2), *rng.uniform(-0.03, 0.03, 2)], 3)
        at = " ".join(map(str, centre))
        text.append(
            f'<link name="link_{i}"><inertial><origin xyz="{at}"/>'
            f'<mass value="{mass:.3f}"/><inertia ixx="{0.008 * mass:.5f}" iyy="{0.02 * mass:.5f}" '
            f'izz="{0.02 * mass:.5f}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="joint_{i}" type="revolute"><parent link="link_{i - 1}"/>'
            f'<child link="link_{i}"/><origin xyz="{x:.3f} 0 {z:.3f}"/><axis xyz="{AXES[i - 1]}"/>'
            f'<limit lower="-2.9" upper="2.9" velocity="2" effort="0"/></joint>'
        )
    text.append(
        f'<link name="tcp"/><joint name="end" type="fixed"><parent link="link_{joints}"/>'
        f'<child link="tcp"/><origin xyz="0.18 0.03 0.05"/></joint></robot>'
    )
    return "\n".join(text)
