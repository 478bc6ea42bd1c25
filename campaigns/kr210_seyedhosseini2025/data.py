"""Data for Seyed Hosseini et al. 2025: hits at 254 postures, modes by the four-step check.

A KR210-like robot in MuJoCo along a trajectory of its tool; three axes at three levels, everyday
errors (`planner.studies.hits`), modal analysis, tracking, and the check of neighbouring postures
(`four_steps`).
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.campaign import labels
from planner.dynamics.simulation import Simulation
from planner.modal.tracking import Guide, track
from planner.progress import ProgressCallback, part_of
from planner.proof.arms import KR210
from planner.proof.deviation import Deviation
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.proof.model import Truth
from planner.robot.robot import Robot
from planner.studies.hits import everyday_faults, simulate_hits, upright_poses

from .four_steps import Checked, check

POSTURES, FEW_POSTURES = 254, 32  # of the paper; of the small version
MODES, TABLED = 6, 4  # modes 5 and 6 are there for the FRFs up to 40 Hz
X_M, Y_M, Z_M = np.linspace(1.3, 1.9, 7), np.linspace(-0.6, 0.6, 8), np.linspace(0.7, 1.2, 5)
TURN_RAD, TURNS = np.deg2rad(30.0), 7.3  # of the tool about itself: size, times along the path
START_DEG = (0.0, -90.0, 100.0, 0.0, 80.0, 0.0)
BAND_HZ = (4.0, 60.0)
HAMMER = Hammer(oversampling=8)
FREQUENCY, DAMPING, RESIDUE = slice(0, MODES), slice(MODES, 2 * MODES), slice(2 * MODES, 8 * MODES)


@dataclass(frozen=True, eq=False)
class PostureData:
    """Postures q (n, 6) in rad, x scaled to [0, 1], parameters as measured and as they are.

    Columns (48): log f of six modes, log ζ, then Rxx, Ryy, Rzz real and imaginary, mode by mode;
    `measured` is NaN where a mode was not found.
    """

    q: np.ndarray
    x: np.ndarray
    measured: np.ndarray
    clean: np.ndarray
    truth: Truth
    checked: Checked
    unchecked_hz: np.ndarray  # (n, modes) before the check


def load(folder: Path, seed: int, small: bool, progress: ProgressCallback) -> PostureData:
    """Hits, modes, tracking and check at all postures; `folder` holds the robot's files."""
    robot_toml = KR210.write(folder, 3)
    truth = load_truth(robot_toml, Deviation(seed, 0.15, 0.4, 0.05, mixed=1.0))
    q = trajectory(truth)
    q = q[-FEW_POSTURES:] if small else q
    x = (q - q.min(axis=0)) / np.maximum(np.ptp(q, axis=0), 1e-3)  # joint 4 hardly moves
    injected = everyday_faults(truth, seed)
    struck = simulate_hits(truth, injected, q, HAMMER, BAND_HZ, seed, part_of(progress, 0.0, 0.7))
    found, doubtful = struck.modes(BAND_HZ, part_of(progress, 0.7, 1.0))
    simulated = Simulation(Robot.load(robot_toml)).modes(q, MODES + 2)
    guide = Guide(simulated.frequency_hz, simulated.shape)
    tracks = track(found, guide, x, ordered=True)
    labelled = [row[:MODES] for row in tracks.modes]
    spare = [(*some, *rest) for some, rest in zip(tracks.unexpected, doubtful, strict=True)]
    checked = check(struck.frfs, labelled, spare)
    clean = np.array([parameters(*truth.modes(posture, MODES)) for posture in q])
    told = labels.gathered(x, checked.modes, simulated[:, :MODES])
    each = zip(told.frequency_hz, told.damping_ratio, told.residue, strict=True)
    measured = np.array([parameters(*posture) for posture in each])
    return PostureData(q, x, measured, clean, truth, checked, tracks.frequency_hz[:, :MODES])


def trajectory(truth: Truth) -> np.ndarray:
    """Joint angles (254, 6) in rad: the tool, upright, goes to and fro, row by row, level by level.

    InputError if the robot cannot stand somewhere.
    """
    places = [
        (x, y, z)
        for k, z in enumerate(Z_M)
        for j, y in enumerate(Y_M[:: 1 - 2 * (k % 2)])
        for x in X_M[:: 1 - 2 * (j % 2)]
    ][:POSTURES]
    turns = TURN_RAD * np.sin(2 * np.pi * TURNS * np.linspace(0, 1, POSTURES))
    targets = zip(np.array(places), turns, strict=True)
    return upright_poses(truth, targets, np.deg2rad(START_DEG), "the trajectory")


def parameters(f: np.ndarray, zeta: np.ndarray, residue: np.ndarray) -> np.ndarray:
    """The columns of `PostureData` from modes' f (m,), ζ (m,) and residues (m, 3, 3)."""
    direct = np.diagonal(residue, axis1=1, axis2=2)
    parts = np.stack([direct.real, direct.imag], axis=-1)
    return np.concatenate([np.log(f), np.log(zeta), parts.ravel()])


def stiffnesses(columns: np.ndarray) -> np.ndarray:
    """Log modal stiffness (n, 12) of the first four modes along x, y, z, of such columns (n, 48).

    ω_n² m / φ², where a residue of a real mode is φ² / (2 m ω_n) in size.
    """
    parts = columns[:, RESIDUE].reshape(len(columns), MODES, 3, 2)[:, :TABLED]
    omega = np.log(2 * np.pi) + columns[:, FREQUENCY][:, :TABLED, None]
    return (omega - np.log(2 * np.hypot(parts[..., 0], parts[..., 1]))).reshape(len(columns), -1)
