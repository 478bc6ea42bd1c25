"""Gauss–Newton with Levenberg–Marquardt damping, for every fit of modes."""

from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np


class Point(Protocol):
    """χ² at one set of parameters and the equations of a step from there."""

    @property
    def chi2(self) -> float: ...

    @property
    def gradient(self) -> np.ndarray:
        """(n,) half the fall of χ² per unit of each parameter."""
        ...

    @property
    def hessian(self) -> np.ndarray:
        """(n, n) JᵀWJ, half the curvature of χ²."""
        ...


P = TypeVar("P", bound=Point)


def descend(
    evaluate: Callable[[np.ndarray], P],
    start: np.ndarray,
    allowed: Callable[[np.ndarray], bool],
    max_iterations: int,
) -> tuple[np.ndarray, P, bool]:
    """Parameters (n,) at the least χ² met from `start`, the point there, and if it converged.

    A step to parameters that are not `allowed` is shortened.
    """
    x, point, damping = start, evaluate(start), 1e-3
    for _ in range(max_iterations):
        diagonal = np.diag(point.hessian)
        scale = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
        hessian = point.hessian / scale[:, None] / scale
        step = np.linalg.solve(hessian + damping * np.eye(x.size), point.gradient / scale) / scale
        trial = evaluate(x + step) if allowed(x + step) else None
        gain = -np.inf if trial is None else point.chi2 - trial.chi2
        # Rounding may make a step worse that is far below any standard deviation.
        small = np.max(np.abs(step) * scale) < 1e-3 or abs(gain) < 1e-9 * point.chi2
        settled = small and trial is not None and damping < 1e-3
        if trial is not None and gain >= 0:
            x, point, damping = x + step, trial, damping / 10
        else:
            damping *= 10
        if settled:
            return x, point, True
        if damping > 1e8:
            break
    return x, point, False
