"""The peak of a log density within bounds by L-BFGS, as of hyperparameters (MAP)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

LogDensity = Callable[[np.ndarray], tuple[float, np.ndarray]]

# Stands for the objective where it is not finite, as beyond a failed Cholesky factor: larger than
# any −log density met, yet finite, so that the line search comes back by a shorter step.
INFEASIBLE = 1e10
RELATIVE_TOLERANCE = 2.22e-9  # scipy's default: 1e7 times the rounding of a double


@dataclass(frozen=True, eq=False)
class Peak:
    """The highest point found: x (p,) and the log density there (−∞ if none was finite)."""

    x: np.ndarray
    log_density: float


def maximise(
    log_density: LogDensity,
    starts: Sequence[np.ndarray],
    lower: float | np.ndarray,
    upper: float | np.ndarray,
    most_steps: int = 200,
    relative_tolerance: float = RELATIVE_TOLERANCE,
) -> Peak:
    """The best end of L-BFGS-B (Byrd et al. 1995) from each of `starts`.

    Args:
        log_density: maps x (p,) to the log density and its gradient (p,); where either is not
            finite, x is infeasible and the step is shortened. jax arrays may be returned.
        starts: points (p,) to begin at, one at least.
        lower: least value of each entry of x, one for all or (p,).
        upper: greatest value of each entry of x, one for all or (p,).
        most_steps: iterations from each start.
        relative_tolerance: an iteration that gains less than this share of the log density is the
            last.

    Returns:
        The highest end; the first start with −∞ where the log density was nowhere finite.
    """

    def negative(x: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = log_density(x)
        value, slope = float(value), np.array(slope, dtype=float)
        if not (np.isfinite(value) and np.isfinite(slope).all()):
            return INFEASIBLE, np.zeros(len(x))
        return -value, -slope

    ones = np.ones(len(starts[0]))
    bounds = list(zip(lower * ones, upper * ones, strict=True))
    best = Peak(np.asarray(starts[0]), -np.inf)
    for start in starts:
        done = minimize(
            negative,
            start,
            jac=True,
            method="L-BFGS-B",
            bounds=bounds,
            options={"maxiter": most_steps, "ftol": relative_tolerance},
        )
        if done.fun < min(INFEASIBLE, -best.log_density):
            best = Peak(done.x, -float(done.fun))
    return best
