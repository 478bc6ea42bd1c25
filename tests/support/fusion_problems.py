"""Two-fidelity problems of the literature on the unit cube.

Forrester et al. 2007; Perdikaris et al. 2017 (Branin); Xiong, Qian & Wu 2013 (Currin).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

LOW_POINTS = {1: 25, 2: 50}  # by dimension
TEST_POINTS = 400


@dataclass(frozen=True)
class Problem:
    """`high` and `low` take x (n, d) in [0, 1] and return (n,)."""

    d: int
    high: Callable[[np.ndarray], np.ndarray]
    low: Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Design:
    """Nested design: x_high is the head of x_low."""

    x_low: np.ndarray
    y_low: np.ndarray
    x_high: np.ndarray
    y_high: np.ndarray
    x_test: np.ndarray
    y_test: np.ndarray


def design(problem: Problem, n: int, seed: int) -> Design:
    """n expensive points of a Latin hypercube; the cheap ones add a scrambled Sobol set."""
    rng = np.random.default_rng(1000 * seed + n)
    x_high = qmc.LatinHypercube(problem.d, rng=rng).random(n)
    more = LOW_POINTS[problem.d] - n
    sobol = qmc.Sobol(problem.d, scramble=True, rng=rng)
    x_low = np.vstack([x_high, sobol.random_base2(7)[:more]])
    test = qmc.Sobol(problem.d, scramble=True, rng=np.random.default_rng(77))
    x_test = test.random_base2(9)[:TEST_POINTS]
    return Design(
        x_low, problem.low(x_low), x_high, problem.high(x_high), x_test, problem.high(x_test)
    )


def _forrester(x: np.ndarray) -> np.ndarray:
    return (6 * x[:, 0] - 2) ** 2 * np.sin(12 * x[:, 0] - 4)


def _forrester_low(x: np.ndarray) -> np.ndarray:
    return 0.5 * _forrester(x) + 10 * (x[:, 0] - 0.5) - 5


def _branin_raw(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    bowl = b - 5.1 / (4 * np.pi**2) * a**2 + 5 / np.pi * a - 6
    return bowl**2 + 10 * (1 - 1 / (8 * np.pi)) * np.cos(a) + 10


def _branin(x: np.ndarray) -> np.ndarray:
    return _branin_raw(15 * x[:, 0] - 5, 15 * x[:, 1])


def _branin_low(x: np.ndarray) -> np.ndarray:
    a, b = 15 * x[:, 0] - 5, 15 * x[:, 1]
    return 10 * np.sqrt(_branin_raw(a - 2, b - 2)) + 2 * (a - 0.5) - 3 * (3 * b - 1) - 1


def _currin(x: np.ndarray) -> np.ndarray:
    a, b = x[:, 0], np.maximum(x[:, 1], 1e-8)
    top = 2300 * a**3 + 1900 * a**2 + 2092 * a + 60
    bottom = 100 * a**3 + 500 * a**2 + 4 * a + 20
    return (1 - np.exp(-0.5 / b)) * top / bottom


def _currin_low(x: np.ndarray) -> np.ndarray:
    shifts = [(0.05, 0.05), (0.05, -0.05), (-0.05, 0.05), (-0.05, -0.05)]
    moved = [np.column_stack([x[:, 0] + a, np.maximum(x[:, 1] + b, 0)]) for a, b in shifts]
    return np.mean([_currin(m) for m in moved], axis=0)


PROBLEMS: dict[str, Problem] = {
    "forrester": Problem(1, _forrester, _forrester_low),
    "branin": Problem(2, _branin, _branin_low),
    "currin": Problem(2, _currin, _currin_low),
}
