"""Nested space-filling designs over a pool of poses: every prefix of one is a design itself."""

import warnings
from functools import lru_cache

import numpy as np
from scipy.stats import qmc

from planner.design.space_filling import nearest


def random(x: np.ndarray, count: int, seed: int) -> np.ndarray:
    """`count` indices into x (n, d), in random order."""
    return np.random.default_rng(seed).permutation(len(x))[:count]


def sobol(x: np.ndarray, count: int, seed: int) -> np.ndarray:
    """The poses (indices) of x (n, d) nearest to a scrambled Sobol sequence."""
    power = int(np.ceil(np.log2(count + 1)))
    sampler = qmc.Sobol(x.shape[1], scramble=True, rng=np.random.default_rng(seed))
    return nearest(x, sampler.random_base2(power), count)


def maximin_lhs(x: np.ndarray, count: int, seed: int) -> np.ndarray:
    """The poses (indices) of x (n, d) nearest to a maximin Latin hypercube, farthest first.

    The hypercube has `count` points (scikit-optimize, as in Busch et al. 2022), taken in the order
    in which each is the farthest from all before it, so that every prefix is spread evenly too.
    """
    return nearest(x, _farthest_first(_hypercube(count, x.shape[1], seed)), count)


NESTED = {"random": random, "sobol": sobol, "maximin_lhs": maximin_lhs}


@lru_cache(maxsize=64)
def _hypercube(count: int, dimensions: int, seed: int) -> np.ndarray:
    from skopt.sampler import Lhs

    if count < 2:  # no distance to maximise
        return np.full((count, dimensions), 0.5)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        lhs = Lhs(lhs_type="classic", criterion="maximin", iterations=200)
        return np.array(lhs.generate([(0.0, 1.0)] * dimensions, count, random_state=seed))


def _farthest_first(points: np.ndarray) -> np.ndarray:
    """The points (n, d) in another order, the most central one first."""
    order = [int(np.argmin(np.linalg.norm(points - 0.5, axis=1)))]
    while len(order) < len(points):
        apart = np.linalg.norm(points[:, None] - points[order][None], axis=2).min(axis=1)
        apart[order] = -1.0
        order.append(int(np.argmax(apart)))
    return points[order]
