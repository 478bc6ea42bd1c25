"""Data for Busch et al. 2020: one FRF over joint 3, hit to 105°; the robot has an extra mode.

The published robot (`campaigns/kr240_busch2020`) as MuJoCo has it, with stiffnesses, damping and
inertias of its own and, on its arm, a dress pack of hoses that sways across; damping of its own at
each visit, friction, everyday errors of hits and chain (`planner.studies.hits`). Driving-point
accelerance across the arm's plane, as in the paper. With the paper's measurement (8 → 10, 22 → 17
and 25 → 19 Hz) it has in common that three resonances show there, of which the simulation has two.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import SimulatedModes
from planner.progress import ProgressCallback, no_progress
from planner.proof.deviation import AttachedResonator, Deviation
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.proof.model import Truth
from planner.robot.robot import Robot
from planner.studies.hits import HitPoses, everyday_faults, simulate_hits

BAND_HZ = (5.0, 30.0)
SWEEP_DEG = (70.0, 120.0)
TRAINED_DEG = 105.0
SIMULATED_SHAPE = (251, 51)  # lines by angles: 12,801 points
MEASURED_LINES, MEASURED_ANGLES = 138, 19  # 2,622 points
HEARD_HZ = (4.0, 40.0)  # of the FRFs: a little beyond the band
# A record of 5.48 s, whose lines are as far apart as those of the measured points.
HAMMER = Hammer(sampling_rate_hz=200.0, record_s=5.48, oversampling=16)
BEYOND_DEG = np.arange(106.0, 121.0)
LACKS = "local_resonator", "link_3"  # what a diagnosis should say of it
DRESS_PACK = AttachedResonator("link_3", (0.2, 0.3, -0.18), (0.0, 0.0, 1.0), 40.0, 21.0, 0.03)
ACROSS = 2  # the tcp axis that lies across the arm's plane


@dataclass(frozen=True, eq=False)
class Sweep:
    """What is measured at angles (n,) in ° and simulated, and the truth beyond."""

    lines_hz: np.ndarray  # (f,) of what is measured
    angles_deg: np.ndarray  # (n,)
    hit_poses: HitPoses  # hits across only, at n angles
    truth: np.ndarray  # (f, p) amplitude at BEYOND_DEG
    simulated: np.ndarray  # (f', p') amplitude on `simulated_axes`
    simulation: Simulation

    @property
    def simulated_axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Lines in Hz and angles in ° of the simulated surface."""
        return _axes(SIMULATED_SHAPE, SWEEP_DEG)

    @property
    def amplitude(self) -> np.ndarray:
        """(f, n) of the driving point, in m/s²/N, between the lines of each record."""
        columns = []
        for frf in self.hit_poses.frfs:
            h = frf.accelerance[ACROSS, ACROSS]
            parts = [np.interp(self.lines_hz, frf.frequency_hz, part) for part in (h.real, h.imag)]
            columns.append(np.hypot(*parts))
        return np.transpose(columns)

    def every(self, step: int) -> "Sweep":
        """With every so manyth experiment only."""
        kept = slice(None, None, step)
        struck = self.hit_poses
        some = HitPoses(struck.q[kept], struck.frfs[kept], struck.hits[kept])
        return replace(self, angles_deg=self.angles_deg[kept], hit_poses=some)

    def modes(self, angles_deg: np.ndarray, count: int) -> SimulatedModes:
        """What the simulation says at angles (n,) in °."""
        return self.simulation.modes(poses(angles_deg), count)


def poses(angles_deg: np.ndarray) -> np.ndarray:
    """Joint angles (n, 6) in rad of the sweep."""
    held = np.array([0.0, -75.0, 0.0, 0.0, 45.0, 90.0])
    return np.deg2rad(held + np.asarray(angles_deg)[:, None] * (np.arange(6) == 2))


def true_robot(seed: int) -> Truth:
    """The robot that is measured, each seed another one."""
    return load_truth(
        _robot_toml(),
        Deviation(seed, stiffness=0.1, damping=0.3, inertia=0.04, com_m=0.005, mixed=1.0,
                  resonators=(DRESS_PACK,)),
    )  # fmt: skip


def sweep(seed: int, progress: ProgressCallback = no_progress) -> Sweep:
    """Robot, hits and noise of one seed."""
    truth = true_robot(seed)
    angles = np.linspace(SWEEP_DEG[0], TRAINED_DEG, MEASURED_ANGLES)
    # Slower than half the sampling rate all is kept; hits are wanted to well above the band.
    q, faults = poses(angles), everyday_faults(truth, seed)
    struck = simulate_hits(truth, faults, q, HAMMER, HEARD_HZ, seed, progress, axes="z")
    lines = np.linspace(*BAND_HZ, MEASURED_LINES)
    beyond = [truth.accelerance(q, lines)[ACROSS, ACROSS] for q in poses(BEYOND_DEG)]
    simulation = Simulation(Robot.load(_robot_toml()))
    low_lines, low_angles = _axes(SIMULATED_SHAPE, SWEEP_DEG)
    low = simulation.accelerance(poses(low_angles), low_lines)[:, ACROSS, ACROSS]
    return Sweep(lines, angles, struck, np.abs(beyond).T, np.abs(low).T, simulation)


def _robot_toml() -> Path:
    return Path(__file__).parent / "robot" / "robot.toml"


def _axes(shape: tuple[int, int], angles_deg: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    return np.linspace(*BAND_HZ, shape[0]), np.linspace(*angles_deg, shape[1])
