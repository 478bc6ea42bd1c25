"""Frequencies of true robots (MuJoCo) that scatter from visit to visit.

A visit's ln f is the pose's plus scatter, half of its variance common to all modes, half each
mode's own; EMA adds a noise whose sd it states. What is scored are new visits at other poses.
"""

import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from planner.dynamics.vibration import SimulatedModes
from planner.proof.arms import ARMS
from planner.proof.deviation import Deviation, soft_floor
from planner.proof.load import load_truth
from planner.surrogate.modal_surrogate import ModalObservations

MODES, POOL, NEW_VISITS = 4, 150, 100
EMA_SD = 1e-3  # of ln f
OFF = 0.003  # rms of ln f that an identified simulation is off by, smoothly over the poses
FLOOR_STIFFNESS = 25.0  # of the truth's floor over the stiffest stated joint


@dataclass(frozen=True, eq=False)
class TrueRobot:
    """Poses x (POOL, d) in [0, 1] and ln f (POOL, MODES): the truth's and two simulations'."""

    x: np.ndarray
    truth: np.ndarray
    simulated: dict[str, np.ndarray]


ROBOTS = tuple(ARMS)


@cache
def true_robot(name: str) -> TrueRobot:
    """One of ROBOTS; a second of MuJoCo the first time."""
    seed, arm = ROBOTS.index(name), ARMS[name]
    toml = arm.write(Path(tempfile.mkdtemp()), 2)
    stiffness = FLOOR_STIFFNESS * max(*arm.torsion, *arm.bending)
    floor = soft_floor(stiffness, stiffness)
    true = load_truth(toml, Deviation(seed + 1, 0.15, 0.15, 0.05, 0.005, extra=floor))
    rng = np.random.default_rng(seed)
    low, high = np.deg2rad(np.transpose(arm.joints_deg))
    x = rng.random((POOL, len(low)))
    q = low + x * (high - low)
    truth = np.log([true.modes(pose, MODES)[0] for pose in q])
    simulated = {
        "identified": truth + OFF * _smooth(x, rng),
        "offset": truth + 0.05 * rng.standard_normal(MODES) + OFF / 3 * _smooth(x, rng),
    }
    return TrueRobot(x, truth, simulated)


def _smooth(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(n, MODES) of rms 1: sums of waves over the box."""
    directions = 2.0 * rng.standard_normal((MODES, 8, x.shape[1]))
    waves = np.cos(np.einsum("mwd,nd->nmw", directions, x) + 2 * np.pi * rng.random((MODES, 8)))
    total = waves.sum(axis=2)
    return total / np.sqrt(np.mean(total**2, axis=0))


def visits(shape: tuple[int, int], scatter: float, rng: np.random.Generator) -> np.ndarray:
    """What visits add to ln f (n, k): half of the variance is common to a visit's modes."""
    common, own = rng.standard_normal((shape[0], 1)), rng.standard_normal(shape)
    return scatter * np.sqrt(0.5) * (common + own)


@dataclass(frozen=True, eq=False)
class Visited:
    """Measured poses, and new visits elsewhere: x (u, d), simulated ln f and what they show."""

    seen: ModalObservations
    x: np.ndarray
    simulated: np.ndarray
    shown: np.ndarray


def visited(name: str, simulation: str, n: int, scatter: float, seed: int) -> Visited:
    """A robot measured at n poses, and NEW_VISITS (less what there is not) at others."""
    robot = true_robot(name)
    rng = np.random.default_rng([seed, n, ROBOTS.index(name)])
    order = rng.permutation(POOL)
    used, new = order[:n], order[n : n + NEW_VISITS]
    low = robot.simulated[simulation]
    measured = robot.truth[used] + visits((n, MODES), scatter, rng)
    measured += EMA_SD * rng.standard_normal((n, MODES))
    shown = robot.truth[new] + visits((len(new), MODES), scatter, rng)
    return Visited(observations(robot.x[used], measured, low[used]), robot.x[new], low[new], shown)


def observations(x: np.ndarray, measured: np.ndarray, low: np.ndarray) -> ModalObservations:
    """ln f (n, k) measured and simulated, as the surrogate wants them; damping says nothing."""
    n, k = measured.shape
    nothing, residue = np.full((n, k), np.nan), np.full((n, k, 3, 3), np.nan + 0j)
    hz = np.exp(measured)
    return ModalObservations(
        x, hz, EMA_SD * hz, nothing, nothing, residue, np.full((n, k, 3, 3), np.nan),
        modes_of(low),
    )  # fmt: skip


def modes_of(low: np.ndarray) -> SimulatedModes:
    """A simulation that gives ln f (n, k), and says nothing of the rest."""
    return SimulatedModes(
        np.exp(low), np.full(low.shape, np.nan), np.full((*low.shape, 3, 3), np.nan + 0j)
    )
