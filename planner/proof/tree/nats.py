"""How much the recordings tell of an effect: half the drop of chi-square by it.

The FRFs with the effect are fitted by the robot without it, moved within what may err anyway:
springs, dampers, loss factors, inertias (adjusted.py; Gauss-Newton steps), sensor's gains,
cross-axis and place, force gain, over all poses; misses of hits and readback, pose by pose
(linear columns).

    chi2 = |r - D x|2 + |x|2 in units of the FRFs' noise and 0.3 % of |H|, x in prior sds

(and once more with 1 %, below which `planner` need not explain anything).

The allowed error comes down to 0.3 % in stages, so that far modes are found, by damped
Gauss-Newton steps from several starts; nats are those of the best fit.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.proof.tree.adjusted import adjusted, columns
from planner.proof.tree.layouts import Robot
from planner.proof.tree.spatial import cross_matrix
from planner.proof.tree.system import System

MODEL_ERROR, NEED_NOT = 0.003, 0.01  # of |H|: what nobody can tell; what need not be explained
STAGES = (0.5, 0.2, 0.07, 0.02, NEED_NOT, MODEL_ERROR)
STEPS, LAST_STEPS = 6, 25  # at most at each stage, and at the last two
DAMPING, LEAST_DAMPING, GIVEN_UP = 1e-2, 1e-6, 1e4
STEADY = 0.003  # a step that lowers chi-square by less of it is the last one
LARGEST = 1.5  # sds a step
GAIN_SD, CROSS_SD, FORCE_SD, PLACE_SD = 0.02, 0.04, 0.02, 0.006
TILT_SD, OFFSET_SD, READBACK_SD = np.radians(2.0), 0.005, np.radians(0.07)


@dataclass(frozen=True)
class Observed:
    """Averaged FRFs of a pose, one set of levels: value and variance (lines, 3, 3 axes)."""

    frf: np.ndarray
    variance: np.ndarray
    hits: np.ndarray  # (3) how many were averaged, by axis


@dataclass(frozen=True)
class Pose:
    """The system without the effect, FRF changes by the readback's sds, and what was observed."""

    system: System
    moved: np.ndarray
    sets: list[Observed]


def _chain_columns(frf: np.ndarray) -> np.ndarray:
    """(13, lines, 3, 3): gains and cross-axis (9), place (3), force gain."""
    h, found = frf[:, :3, :3], []
    for i in range(3):
        for j in range(3):
            unit = np.zeros((3, 3))
            unit[i, j] = GAIN_SD if i == j else CROSS_SD
            found.append(unit @ h)
        found.append(PLACE_SD * cross_matrix(np.eye(3)[i]) @ frf[:, 3:, :3])
    return np.array([*found, FORCE_SD * h])


def _misses(frf: np.ndarray, hits: np.ndarray) -> np.ndarray:
    """(12, lines, 3, 3): direction and place of the hits' average, axis by axis."""
    found = []
    for axis in range(3):
        sd = np.sqrt(1 / hits[axis] + 0.25) if hits[axis] else 0.0
        for lateral in np.delete(np.arange(3), axis):
            for change, size in (
                (frf[:, :3, lateral], TILT_SD),
                (frf[:, :3, 3:] @ np.cross(np.eye(3)[lateral], np.eye(3)[axis]), OFFSET_SD),
            ):
                column = np.zeros((len(frf), 3, 3), complex)
                column[:, :, axis] = sd * size * change
                found.append(column)
    return np.array(found)


def _real(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(…, rows): weighted; real and imaginary parts, each of variance 1 where it is noise."""
    flat = (values * weight).reshape(*values.shape[:-3], -1) * np.sqrt(2)
    return np.concatenate([flat.real, flat.imag], axis=-1)


def _normal(
    pose: Pose, robot: Robot, s: np.ndarray, moves: np.ndarray, error: float, share: float
) -> tuple:
    """Normal equations of a pose over the shared unknowns; its own are eliminated."""
    shared, frf = columns(adjusted(pose.system, robot, moves), robot, s)
    shared = np.concatenate([shared, _chain_columns(frf)])
    rows, local, residual = [], [], []
    for number, seen in enumerate(pose.sets):
        variance = share * (seen.variance + (error * np.abs(seen.frf)) ** 2)
        weight = np.where(seen.hits > 0, 1 / np.sqrt(variance), 0.0)
        misses = _real(_misses(frf, seen.hits), weight)
        blocks = [misses if i == number else 0 * misses for i in range(len(pose.sets))]
        rows.append(_real(shared, weight))
        local.append(np.concatenate([*blocks, _real(pose.moved, weight)]))
        residual.append(_real(seen.frf - frf[:, :3, :3], weight))
    d, own, r = np.hstack(rows), np.hstack(local), np.concatenate(residual)
    inner = np.linalg.cholesky(np.eye(len(own)) + own @ own.T)
    cross, short = np.linalg.solve(inner, own @ d.T), np.linalg.solve(inner, own @ r)
    return d @ d.T - cross.T @ cross, d @ r - cross.T @ short, float(r @ r - short @ short)


def _sum(
    poses: list[Pose], robot: Robot, s: np.ndarray, moves: np.ndarray, error: float, share: float
) -> tuple:
    """Over all poses, and chi-square at `moves` with the chain at its best."""
    parts = [_normal(pose, robot, s, moves, error, share) for pose in poses]
    square, vector, plain = (sum(p[i] for p in parts) for i in range(3))
    size = len(moves)
    chain = np.linalg.solve(np.eye(len(vector) - size) + square[size:, size:], vector[size:])
    return square, vector, plain - float(vector[size:] @ chain) + float(moves @ moves)


def nats_of(
    poses: list[Pose], robot: Robot, s: np.ndarray, share: float, starts: list[np.ndarray]
) -> tuple[float, float]:
    """Half of chi-square that no unknown takes away, at 0.3 % and at 1 % of |H|.

    `share` of all lines are given.
    """
    least = np.min([_fitted(poses, robot, s, share, moves) for moves in starts], axis=0)
    return float(least[0] / 2), float(least[1] / 2)


def _fitted(
    poses: list[Pose], robot: Robot, s: np.ndarray, share: float, moves: np.ndarray
) -> tuple[float, float]:
    """Chi-square of the last two stages from a start; those far away skip the first two."""
    least = {}
    for error in STAGES[2:] if moves.any() else STAGES:
        steps = LAST_STEPS if error <= NEED_NOT else STEPS

        def of(at: np.ndarray, error: float = error) -> tuple:
            return _sum(poses, robot, s, at, error, share)

        moves, least[error] = _descended(of, moves, steps)
    return least[MODEL_ERROR], least[NEED_NOT]


def _descended(
    of: Callable[[np.ndarray], tuple], moves: np.ndarray, steps: int
) -> tuple[np.ndarray, float]:
    """Moves after at most so many damped steps that each lower chi-square, and chi-square."""
    square, vector, least = of(moves)
    damping = DAMPING
    for _ in range(steps):
        before = least
        while damping < GIVEN_UP:
            there = moves + _step(square, vector, moves, damping)
            found = of(there)
            if found[2] < least:
                moves, (square, vector, least) = there, found
                damping = max(damping / 5, LEAST_DAMPING)
                break
            damping *= 6
        if least > (1 - STEADY) * before:
            break
    return moves, least


def _step(square: np.ndarray, vector: np.ndarray, moves: np.ndarray, damping: float) -> np.ndarray:
    """The damped Gauss-Newton step of the moves, none longer than `LARGEST`."""
    prior = np.concatenate([moves, np.zeros(len(vector) - len(moves))])
    curved = np.eye(len(square)) + square
    curved[np.diag_indices_from(curved)] *= 1 + damping
    step = np.linalg.solve(curved, vector - prior)[: len(moves)]
    return step * min(1.0, LARGEST / max(np.max(np.abs(step)), 1e-12))
