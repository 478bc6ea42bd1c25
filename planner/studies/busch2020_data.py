"""Data for Busch et al. 2020: one FRF over joint 3, measured to 105°; the robot has an extra mode.

The published robot (`campaigns/kr240_busch2020`) as MuJoCo has it, with stiffnesses, damping and
inertias of its own and, on its arm, a dress pack of hoses that sways across. Driving-point
accelerance across the arm's plane, as in the paper. With the paper's measurement (8 → 10, 22 → 17
and 25 → 19 Hz) it has in common that three resonances show there, of which the simulation has two.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.demo import shipped
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import SimulatedModes
from planner.frf.frf import Frf
from planner.robot.robot import Robot
from planner.truth.deviation import AttachedResonator, Deviation
from planner.truth.load import load_truth
from planner.truth.model import Truth

BAND_HZ = (5.0, 30.0)
SWEEP_DEG = (70.0, 120.0)
TRAINED_DEG = 105.0
SIMULATED_SHAPE = (251, 51)  # lines by angles: 12,801 points
MEASURED_SHAPE = (138, 19)  # 2,622 points
NOISE, FLOOR = 0.02, 0.005  # of an FRF's line, and of its rms over the band
BEYOND_DEG = np.arange(106.0, 121.0)
DRESS_PACK = AttachedResonator("link_3", (0.2, 0.3, -0.18), (0.0, 0.0, 1.0), 40.0, 21.0, 0.03)
ACROSS = 2  # the tcp axis that lies across the arm's plane
HITS = (0, 0, 10)  # along it only


@dataclass(frozen=True, eq=False)
class Sweep:
    """What is measured at angles (n,) in ° and simulated, and the truth beyond."""

    lines_hz: np.ndarray  # (f,) of what is measured
    angles_deg: np.ndarray  # (n,)
    column: np.ndarray  # (n, 3, f) complex: three responses to the hits across, in m/s²/N
    variance: np.ndarray  # (n, 3, f)
    truth: np.ndarray  # (f, p) amplitude at BEYOND_DEG
    simulated: np.ndarray  # (f', p') amplitude on `simulated_axes`
    simulation: Simulation

    @property
    def simulated_axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Lines in Hz and angles in ° of the simulated surface."""
        return _axes(SIMULATED_SHAPE, SWEEP_DEG)

    @property
    def amplitude(self) -> np.ndarray:
        """(f, n) of the driving point, in m/s²/N."""
        return np.abs(self.column[:, ACROSS]).T

    def every(self, step: int) -> "Sweep":
        """With every so manyth experiment only."""
        kept = slice(None, None, step)
        return Sweep(
            self.lines_hz, self.angles_deg[kept], self.column[kept], self.variance[kept],
            self.truth, self.simulated, self.simulation,
        )  # fmt: skip

    def frf(self, i: int) -> Frf:
        """The FRF matrix at the i-th angle: hit across only."""
        shape = (3, 3, len(self.lines_hz))
        h, variance = np.full(shape, np.nan + 0j), np.full(shape, np.nan)
        h[:, ACROSS], variance[:, ACROSS] = self.column[i], self.variance[i]
        return Frf(self.lines_hz, h, variance, np.full(shape, np.nan), HITS, BAND_HZ)

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
        Deviation(seed, stiffness=0.1, damping=0.15, inertia=0.04, com_m=0.005,
                  resonators=(DRESS_PACK,)),
    )  # fmt: skip


def sweep(seed: int) -> Sweep:
    """Robot and noise of one seed."""
    truth, rng = true_robot(seed), np.random.default_rng([seed, 1])
    lines, angles = _axes(MEASURED_SHAPE, (SWEEP_DEG[0], TRAINED_DEG))
    h = np.array([truth.accelerance(q, lines)[:, ACROSS] for q in poses(angles)])
    size = np.hypot(NOISE * np.abs(h), FLOOR * np.sqrt(np.mean(np.abs(h) ** 2, axis=2))[..., None])
    noise = rng.standard_normal((2, *h.shape)) * size / 2**0.5
    beyond = [truth.accelerance(q, lines)[ACROSS, ACROSS] for q in poses(BEYOND_DEG)]
    simulation = Simulation(Robot.load(_robot_toml()))
    low_lines, low_angles = _axes(SIMULATED_SHAPE, SWEEP_DEG)
    low = simulation.accelerance(poses(low_angles), low_lines)[:, ACROSS, ACROSS]
    return Sweep(
        lines, angles, h + noise[0] + 1j * noise[1], size**2, np.abs(beyond).T, np.abs(low).T,
        simulation,
    )  # fmt: skip


def _robot_toml() -> Path:
    return shipped("kr240_busch2020") / "robot" / "robot.toml"


def _axes(shape: tuple[int, int], angles_deg: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    return np.linspace(*BAND_HZ, shape[0]), np.linspace(*angles_deg, shape[1])
