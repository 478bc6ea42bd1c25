"""Baselines that do not look at the model: random, Sobol and maximin Latin hypercube."""

import warnings

import numpy as np
from scipy.stats import qmc


def random(x: np.ndarray, taken: np.ndarray, count: int, seed: int) -> np.ndarray:
    """`count` indices into x (n, d), at random; the same for the same seed."""
    return np.random.default_rng(seed).permutation(len(x))[:count]


def sobol(x: np.ndarray, taken: np.ndarray, count: int, seed: int) -> np.ndarray:
    """The candidates nearest to the next points of a Sobol sequence, after those taken."""
    power = int(np.ceil(np.log2(len(taken) + count + 1)))
    points = qmc.Sobol(x.shape[1], scramble=True, rng=np.random.default_rng(0)).random_base2(power)
    return nearest(x, points[len(taken) :], count)


def maximin_lhs(x: np.ndarray, taken: np.ndarray, count: int, seed: int) -> np.ndarray:
    """The candidates nearest to a maximin Latin hypercube.

    By scikit-optimize, as in Busch et al. 2022. The hypercube has room for what is taken; its
    points nearest to those are passed over.
    """
    from skopt.sampler import Lhs

    total = len(taken) + count
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        lhs = Lhs(lhs_type="classic", criterion="maximin", iterations=200)
        points = np.array(lhs.generate([(0.0, 1.0)] * x.shape[1], total, random_state=0))
    for place in taken:
        points = np.delete(points, np.argmin(np.sum((points - place) ** 2, axis=1)), axis=0)
    return nearest(x, points, count)


def nearest(x: np.ndarray, points: np.ndarray, count: int) -> np.ndarray:
    """For each point the nearest candidate not yet chosen; indices (≤ count,)."""
    chosen: list[int] = []
    for point in points:
        distance = np.sum((x - point) ** 2, axis=1)
        distance[chosen] = np.inf
        if len(chosen) == min(count, len(x)):
            break
        chosen.append(int(np.argmin(distance)))
    return np.array(chosen, dtype=int)
