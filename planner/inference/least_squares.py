"""Levenberg-Marquardt on an objective that gives its own Gauss-Newton matrix."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
import scipy.linalg

LONGEST = 1.5  # no parameter moves farther in one step: a factor of 4.5 for a logarithm


@dataclass(frozen=True, eq=False)
class Quadratic:
    """Objective at a point: value, gradient (P,), Gauss-Newton matrix (P, P), χ² of the data."""

    value: float
    gradient: np.ndarray
    normal: np.ndarray
    chi2: float


Q = TypeVar("Q", bound=Quadratic)


@dataclass(frozen=True, eq=False)
class Minimum(Generic[Q]):
    """Where the iteration ended, and whether it had come to rest."""

    x: np.ndarray
    at: Q
    iterations: int
    converged: bool


def inverse(precision: np.ndarray) -> np.ndarray:
    """Covariance (p, p) of a precision that is positive, but for rounding: so is the answer.

    Where a barrier stands close, entries differ by so many decades that a plain inverse loses it.
    """
    unit = 1 / np.sqrt(np.diagonal(precision))
    values, vectors = scipy.linalg.eigh(precision * np.outer(unit, unit))
    values = np.maximum(values, np.finfo(float).eps * len(unit) * values[-1])
    return np.outer(unit, unit) * ((vectors / values) @ vectors.T)


def minimise(
    objective: Callable[[np.ndarray], Q],
    start: np.ndarray,
    tolerance: float,
    most: int,
    progress: Callable[[int, float], None] | None = None,
    longest: float | np.ndarray = LONGEST,
    at: Q | None = None,
) -> Minimum[Q]:
    """Least value from `start`, until a step would gain less than `tolerance` of it.

    `at` is the objective there, where that is known.

    Damping follows Nielsen 1999; each step is shortened so that no entry moves by over
    `longest` (that of each, or one for all).
    """
    x, at = start, at or objective(start)
    damping, grow = 1e-2, 2.0
    for iteration in range(1, most + 1):
        if progress:
            progress(iteration, at.value)
        scale = np.diagonal(at.normal)
        # In units in which the diagonal is 1: parameters of any size are solved for as well.
        unit = 1 / np.sqrt(scale)
        damped = at.normal * np.outer(unit, unit) + damping * np.eye(len(unit))
        factor = scipy.linalg.cho_factor(damped, overwrite_a=True, check_finite=False)
        step = -unit * scipy.linalg.cho_solve(factor, unit * at.gradient, check_finite=False)
        step *= min(1.0, 1 / max(float(np.max(np.abs(step) / longest)), 1e-300))
        expected = -(at.gradient @ step + step @ at.normal @ step / 2)
        if expected <= tolerance * at.value:
            return Minimum(x, at, iteration, True)
        trial = objective(x + step)
        gain = (at.value - trial.value) / expected if np.isfinite(trial.value) else -1.0
        if gain > 0:
            x, at = x + step, trial
            damping, grow = max(damping * max(1 / 5, 1 - (2 * gain - 1) ** 3), 1e-9), 2.0
        else:
            damping, grow = damping * grow, grow * 2
            if damping > 1e12:
                return Minimum(x, at, iteration, False)
    return Minimum(x, at, most, False)
