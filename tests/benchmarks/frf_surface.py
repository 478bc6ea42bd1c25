"""Seed 001's problem: accelerance over (frequency, angle of joint 3), measured up to 105° only.

No such recording is public. The stand-in: the shipped robot as MuJoCo has it, its joint 3 turned
from 70° to 120°, amplitude noise 2 %; the simulation lacks one elastic rotation, and with it the
mode near 20 Hz that carries most of the response.
"""

import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tomlkit

from planner.physics.dynamics import SimulatedModes
from planner.physics.simulation import Simulation
from planner.robot.robot import Robot
from planner.truth.model import Truth, load_truth

CAMPAIGN = Path(__file__).parents[2] / "campaigns" / "kr240_plane"
MISSING = 4  # elastic rotation (joint 2, across) that the simulation does not have
BAND_HZ = (5.0, 40.0)
LOW_SHAPE, HIGH_LINES = (251, 51), 73  # 12,801 simulated points; 36 × 73 measured ones


@dataclass(frozen=True, eq=False)
class Surface:
    """Points x (n, 2) = (frequency in Hz, angle in °) and amplitude (n,) in m/s²/N."""

    x: np.ndarray
    amplitude: np.ndarray


def simulated(folder: Path) -> tuple[Surface, Callable[[np.ndarray, int], SimulatedModes]]:
    """The simulation's surface, 51 angles by 251 lines, angle by angle; its modes at angles."""
    robot = folder / "robot"
    shutil.copytree(CAMPAIGN / "robot", robot)
    table = tomlkit.parse((robot / "robot.toml").read_text())
    del table["compliance"][MISSING]
    (robot / "robot.toml").write_text(tomlkit.dumps(table))
    simulation = Simulation(Robot.load(robot / "robot.toml"))
    lines = np.linspace(*BAND_HZ, LOW_SHAPE[0])
    angles = np.linspace(70.0, 120.0, LOW_SHAPE[1])
    h = simulation.accelerance(np.array([_pose(a) for a in angles]), lines)[:, 2, 2]

    def modes(angles_deg: np.ndarray, count: int) -> SimulatedModes:
        return simulation.modes(np.array([_pose(a) for a in angles_deg]), count)

    return _surface(lines, angles, np.abs(h)), modes


def measured(every: int = 1, seed: int = 1) -> tuple[Surface, Surface]:
    """What is measured (70° … 105°, every so many degrees) and what is to be told (to 120°)."""
    truth = _truth()
    lines = np.linspace(*BAND_HZ, HIGH_LINES)
    angles = np.arange(70.0, 121.0)
    h = np.abs([truth.accelerance(_pose(a), lines)[2, 2] for a in angles])
    noisy = h * (1 + 0.02 * np.random.default_rng(seed).standard_normal(h.shape))
    seen = (angles <= 105) & (np.arange(len(angles)) % every == 0)
    beyond = angles > 105
    return _surface(lines, angles[seen], noisy[seen]), _surface(lines, angles[beyond], h[beyond])


def measured_matrix(every: int = 1, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Angles (n,) in ° up to 105 and their FRF matrices (n, 3, 3, f), noise 2 % of amplitude."""
    truth, rng = _truth(), np.random.default_rng(seed)
    angles = np.arange(70.0, 106.0)[::every]
    h = np.array([truth.accelerance(_pose(a), np.linspace(*BAND_HZ, HIGH_LINES)) for a in angles])
    noise = rng.standard_normal(h.shape) + 1j * rng.standard_normal(h.shape)
    return angles, h + 0.02 * np.abs(h) * noise / 2**0.5


def _truth() -> Truth:
    sys.path.insert(0, str(CAMPAIGN))
    from regenerate import DEVIATION

    return load_truth(CAMPAIGN / "robot" / "robot.toml", DEVIATION)


def _pose(angle_deg: float) -> np.ndarray:
    return np.deg2rad([0.0, -75.0, angle_deg, 0.0, -45.0, 90.0])


def _surface(lines: np.ndarray, angles: np.ndarray, amplitude: np.ndarray) -> Surface:
    x = np.column_stack([np.tile(lines, len(angles)), np.repeat(angles, len(lines))])
    return Surface(x, amplitude.reshape(-1))
