"""Baselines that do not look at the model: random, Sobol and maximin Latin hypercube.

DESIGNS go on from poses already taken; NESTED order a whole pool so that every prefix of the
order is a design itself.
"""

import warnings
from collections.abc import Callable
from functools import lru_cache

import numpy as np

LHS_ITERATIONS = 200  # random Latin hypercubes of which scikit-optimize keeps the best


def random(x: np.ndarray, taken: np.ndarray, count: int, seed: int) -> np.ndarray:
    """`count` indices into x (n, d), at random; the same for the same seed."""
    return np.random.default_rng(seed).permutation(len(x))[:count]


def sobol(x: np.ndarray, taken: np.ndarray, count: int, seed: int) -> np.ndarray:
    """The candidates nearest to the next points of a Sobol sequence, after those taken."""
    return nearest(x, _sobol(len(taken) + count + 1, x.shape[1], 0)[len(taken) :], count)


def maximin_lhs(x: np.ndarray, taken: np.ndarray, count: int, seed: int) -> np.ndarray:
    """The candidates nearest to a maximin Latin hypercube, as in Busch et al. 2022.

    The hypercube has room for what is taken; its points nearest to those are passed over.
    """
    points = _hypercube(len(taken) + count, x.shape[1], 0)
    for place in taken:
        points = np.delete(points, np.argmin(np.sum((points - place) ** 2, axis=1)), axis=0)
    return nearest(x, points, count)


def nested_sobol(x: np.ndarray, count: int, seed: int) -> np.ndarray:
    """The poses (indices) of x (n, d) nearest to a scrambled Sobol sequence."""
    return nearest(x, _sobol(count + 1, x.shape[1], seed), count)


def nested_maximin_lhs(x: np.ndarray, count: int, seed: int) -> np.ndarray:
    """The poses (indices) of x (n, d) nearest to a maximin Latin hypercube of `count` points.

    They are taken in the order in which each is the farthest from all before it, so that every
    prefix is spread evenly too.
    """
    if count < 2:  # no distance to maximise
        return nearest(x, np.full((count, x.shape[1]), 0.5), count)
    return nearest(x, _farthest_first(_hypercube(count, x.shape[1], seed)), count)


Design = Callable[[np.ndarray, np.ndarray, int, int], np.ndarray]
NestedDesign = Callable[[np.ndarray, int, int], np.ndarray]
DESIGNS: dict[str, Design] = {"random": random, "sobol": sobol, "maximin_lhs": maximin_lhs}
NESTED: dict[str, NestedDesign] = {
    "random": lambda x, count, seed: random(x, x[:0], count, seed),
    "sobol": nested_sobol,
    "maximin_lhs": nested_maximin_lhs,
}


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


def _sobol(count: int, dimensions: int, seed: int) -> np.ndarray:
    """At least `count` points of a scrambled Sobol sequence."""
    from scipy.stats import qmc  # scipy.stats takes most of a second to import

    sampler = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed))
    return sampler.random_base2(int(np.ceil(np.log2(count))))


@lru_cache(maxsize=64)
def _hypercube(count: int, dimensions: int, seed: int) -> np.ndarray:
    """Maximin Latin hypercube (count, dimensions) of scikit-optimize."""
    from skopt.sampler import Lhs

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        lhs = Lhs(lhs_type="classic", criterion="maximin", iterations=LHS_ITERATIONS)
        return np.array(lhs.generate([(0.0, 1.0)] * dimensions, count, random_state=seed))


def _farthest_first(points: np.ndarray) -> np.ndarray:
    """The points (n, d) in another order, the most central one first."""
    order = [int(np.argmin(np.linalg.norm(points - 0.5, axis=1)))]
    while len(order) < len(points):
        apart = np.linalg.norm(points[:, None] - points[order][None], axis=2).min(axis=1)
        apart[order] = -1.0
        order.append(int(np.argmax(apart)))
    return points[order]
