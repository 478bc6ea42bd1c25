"""Problems on which fusion is developed, so that those of `fusion_problems` stay unseen.

Two-fidelity functions of Dong et al. 2015 (camel, Bohachevsky, Booth, Himmelblau), Xiong et al.
2013 (Park, the second), Perdikaris et al. 2017 and Cutajar et al. 2019 (bent waves), the OTL
circuit (Ben-Ari & Steinberg 2007) and the wing's weight (Forrester et al. 2008) with a simulation
that knows less, sums of random waves, and other modes of robots than in `robot_problems`.
"""

from collections.abc import Callable

import numpy as np

from tests.support.fusion_problems import Problem
from tests.support.robot_problems import robot_problem


def _camel(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return 4 * a**2 - 2.1 * a**4 + a**6 / 3 + a * b - 4 * b**2 + 4 * b**4


def _bohachevsky(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a**2 + 2 * b**2 - 0.3 * np.cos(3 * np.pi * a) - 0.4 * np.cos(4 * np.pi * b) + 0.7


def _booth(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a + 2 * b - 7) ** 2 + (2 * a + b - 5) ** 2


def _himmelblau(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a**2 + b - 11) ** 2 + (b**2 + a - 7) ** 2


def _plane(half: float, f: Callable[[np.ndarray, np.ndarray], np.ndarray]):
    return lambda x: f(*(half * (2 * x - 1)).T)


def _park_second(x: np.ndarray) -> np.ndarray:
    a, b, c, d = x.T
    return 2 / 3 * np.exp(a + b) - d * np.sin(c) + c


def _otl(x: np.ndarray, full: bool) -> np.ndarray:
    low = np.array([50, 25, 0.5, 1.2, 0.25, 50])
    high = np.array([150, 70, 3.0, 2.5, 1.2, 300])
    rb1, rb2, rf, rc1, rc2, beta = (low + x * (high - low)).T
    vb = 12 * rb2 / (rb1 + rb2)
    gain = beta * (rc2 + 9)
    out = (vb + 0.74) * gain / (gain + rf)
    return out + (11.35 * rf + 0.74 * rf * gain / rc1) / (gain + rf) if full else out


def _wing(x: np.ndarray, full: bool) -> np.ndarray:
    low = np.array([150, 220, 6, -10, 16, 0.5, 0.08, 2.5, 1700, 0.025])
    high = np.array([200, 300, 10, 10, 45, 1, 0.18, 6, 2500, 0.08])
    s, fuel, a, sweep, q, taper, tc, nz, gross, paint = (low + x * (high - low)).T
    sweep = np.deg2rad(sweep)
    base = 0.036 * s**0.758 * fuel**0.0035 * (a / np.cos(sweep) ** 2) ** 0.6 * q**0.006
    base = base * taper**0.04 * (100 * tc / np.cos(sweep)) ** -0.3 * (nz * gross) ** 0.49
    return base + s * paint if full else base * (1 + 0.02 * q / 45)


def _waves(d: int, seed: int, length: float) -> Callable[[np.ndarray], np.ndarray]:
    """A draw of a GP with RBF kernel, variance 1, as a sum of 200 random waves."""
    rng = np.random.default_rng(seed)
    k, phase = rng.standard_normal((d, 200)) / length, rng.uniform(0, 2 * np.pi, 200)
    weight = rng.standard_normal(200) * 0.1
    return lambda x: np.cos(x @ k + phase) @ weight


def random_problem(d: int, seed: int, slope: float, apart: float) -> Problem:
    """slope·low + apart·δ, both draws of GPs."""
    low, delta = _waves(d, seed, 0.3 * d**0.5), _waves(d, seed + 1, 0.5 * d**0.5)
    return Problem(d, lambda x: slope * low(x) + apart * delta(x), low)


def _wave(shift: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda x: np.sin(8 * np.pi * x[:, 0] + shift)


def _camel_low(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return _camel(0.7 * a, 0.7 * b) + a * b - 15


def _bohachevsky_low(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return _bohachevsky(0.7 * a, b) + a * b - 12


def _booth_low(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return _booth(0.4 * a, b) + 1.7 * a * b - a + 2 * b


def _himmelblau_low(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return _himmelblau(0.5 * a, 0.8 * b) + b**3 - (a + 1) ** 2


DEVELOPMENT: dict[str, Callable[[], Problem]] = {
    "camel": lambda: Problem(2, _plane(2, _camel), _plane(2, _camel_low)),
    "bohachevsky": lambda: Problem(2, _plane(5, _bohachevsky), _plane(5, _bohachevsky_low)),
    "booth": lambda: Problem(2, _plane(10, _booth), _plane(10, _booth_low)),
    "himmelblau": lambda: Problem(2, _plane(4, _himmelblau), _plane(4, _himmelblau_low)),
    "park 2": lambda: Problem(4, _park_second, lambda x: 1.2 * _park_second(x) - 1),
    "otl": lambda: Problem(6, lambda x: _otl(x, True), lambda x: _otl(x, False)),
    "wing": lambda: Problem(10, lambda x: _wing(x, True), lambda x: _wing(x, False)),
    "bent": lambda: Problem(1, lambda x: (x[:, 0] - 2**0.5) * _wave(0)(x) ** 2, _wave(0)),
    "shifted": lambda: Problem(1, lambda x: x[:, 0] ** 2 + _wave(np.pi / 10)(x) ** 2, _wave(0)),
    "near, 1-d": lambda: random_problem(1, 1, 0.6, 0.1),
    "near, 3-d": lambda: random_problem(3, 3, 1.4, 0.15),
    "half, 2-d": lambda: random_problem(2, 5, 1.0, 0.6),
    "irrelevant, 2-d": lambda: random_problem(2, 7, 0.1, 1.0),
    "kr210 mode 1": lambda: robot_problem("kr210", 0, 11),
    "irb6640 mode 2": lambda: robot_problem("irb6640", 1, 12),
    "kr10 mode 3": lambda: robot_problem("kr10", 2, 13),
}
