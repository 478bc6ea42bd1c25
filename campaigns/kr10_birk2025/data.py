"""Data for Birk et al. 2025: a KR10 on three paths, that neither of the paper's models can be.

The truth is of another class than 12P and 24P: three links bend and twist as beams, gears of
Harmonic Drives stiffen in steps, joints rub, the stiffness of joints ripples with the angle, the
table gives way, masses and inertias are others, and stated stiffnesses are off by ± 40 %. So no
set of parameters is the right one, which would be an inverse crime. The paper shows its paths in a
figure only: here they are straight lines of 40 points along x, y and z with the tool downwards.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.progress import ProgressCallback
from planner.proof.deviation import (
    AttachedResonator,
    BentLink,
    Deviation,
    StiffnessRipple,
    soft_floor,
)
from planner.proof.hits import Hammer
from planner.proof.laws import HarmonicDrive
from planner.proof.load import load_truth
from planner.proof.model import Truth
from planner.proof.nonlinear import Port
from planner.studies.hits import HitPoses, everyday_faults, simulate_hits, upright_poses

PATHS = ("S1", "S2", "S3")
POINTS, FEW_POINTS = 40, 4  # of a path; of the small version
ENDS_M = {  # chosen: within the reach of the R1100, tool downwards
    "S1": ((0.32, 0.15, 0.35), (0.92, 0.15, 0.35)),
    "S2": ((0.6, -0.3, 0.35), (0.6, 0.3, 0.35)),
    "S3": ((0.55, 0.15, 0.15), (0.55, 0.15, 0.75)),
}
START_DEG = (0.0, -70.0, 110.0, 0.0, 50.0, 0.0)
BAND_HZ, FULL_HZ = (5.0, 200.0), (5.0, 800.0)
HAMMER = Hammer(
    peak_n=300.0, duration_s=0.0012, sampling_rate_hz=2048.0, record_s=0.64, pretrigger_s=0.03,
    oversampling=4,
)  # fmt: skip
STIFFNESS = 0.23  # log-sd of each stated stiffness: ± 40 % are ± 1.5 sd
STEPS_RAD = 3e-6, 1e-5  # angles at which a Harmonic Drive's stiffness changes, under such hits
RIPPLE = 0.08  # sd of a joint's stiffness over its angle, of each part
STEP = 0.1  # by how much of its own, each time


@dataclass(frozen=True, eq=False)
class PathHits:
    """Hits at all points of the three paths; `path` (n,) names each one's."""

    hit_poses: HitPoses
    path: np.ndarray

    @property
    def names(self) -> list[str]:
        """Such as S2-07, counted along each path from 1."""
        return [f"{p}-{np.sum(self.path[: i + 1] == p):02d}" for i, p in enumerate(self.path)]

    @property
    def ends_and_middles(self) -> np.ndarray:
        """The paper's nine points (9,): first, middle and last of each path."""
        rows = [np.flatnonzero(self.path == path) for path in PATHS]
        return np.concatenate([each[[0, (len(each) - 1) // 2, -1]] for each in rows])


def true_robot(seed: int) -> Truth:
    """The KR10 that is hit."""
    toml = Path(__file__).parent / "robot" / "robot_24p.toml"
    rng = np.random.default_rng([seed, 9])
    beams = (
        BentLink("link_2", (1.5e5, 1.2e5), 1e5, 1e-4),
        BentLink("link_3", (8e4, 8e4), 5e4, 1e-4),
        BentLink("link_4", (4e4, 4e4), 2.5e4, 1e-4),
    )
    ripples = tuple(
        StiffnessRipple(
            f"joint_{k}", int(rng.integers(1, 3)), float(rng.normal(0, RIPPLE)),
            float(rng.normal(0, RIPPLE)),
        )
        for k in range(1, 7)
    )  # fmt: skip
    cables = (
        AttachedResonator("link_3", (0.05, 0.06, 0.05), (0.0, 1.0, 0.0), 0.5, 62.0, 0.06),
        AttachedResonator("link_4", (0.2, 0.0, 0.05), (0.0, 0.0, 1.0), 0.3, 118.0, 0.05),
    )
    return load_truth(
        toml,
        Deviation(seed, STIFFNESS, 0.4, 0.12, 0.015, extra=soft_floor(4e5, 3e5), beams=beams,
                  harmonics=ripples, resonators=cables),
    )  # fmt: skip


def gears(truth: Truth) -> tuple[Port, ...]:
    """Harmonic Drives in all joints: stiffer in steps."""
    return tuple(
        Port(HarmonicDrive(STEP * truth.stiffness(joint), *STEPS_RAD), joint=joint)
        for joint in truth.joint_names
    )


def poses(truth: Truth, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Joint angles (n, 6) in rad and path (n,) of each; InputError if a point is out of reach."""
    places = np.concatenate([np.linspace(*ends, points) for ends in ENDS_M.values()])
    targets = ((place, 0.0) for place in places)
    q = upright_poses(truth, targets, np.deg2rad(START_DEG), "the paths")
    return q, np.repeat(list(ENDS_M), points)


def load(seed: int, small: bool, progress: ProgressCallback) -> PathHits:
    """Hits along x, y and z at three levels at each point, with everyday errors."""
    truth = true_robot(seed)
    q, path = poses(truth, FEW_POINTS if small else POINTS)
    injected = everyday_faults(truth, seed, ports=gears(truth))
    return PathHits(simulate_hits(truth, injected, q, HAMMER, FULL_HZ, seed, progress), path)
