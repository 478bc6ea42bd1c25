"""Do groups differ by more than their members do among themselves? A permutation test.

Where the group says nothing of a member, members shared out among the groups at random differ from
group to group as much as they really do (Anderson 2001, PERMANOVA). Nothing is assumed of how large
their scatter is.
"""

from math import factorial, prod

import numpy as np


def ways(labels: np.ndarray) -> float:
    """Ways to share members out among the groups `labels` (n,) that make a difference."""
    sizes = np.bincount(labels)
    sizes = sizes[sizes > 0]
    orders = prod(factorial(int(n)) for n in np.bincount(sizes))  # groups of equal size
    return factorial(len(labels)) / prod(factorial(int(n)) for n in sizes) / orders


def between(
    values: np.ndarray, labels: np.ndarray, draws: int, rng: np.random.Generator
) -> tuple[float, np.ndarray]:
    """n/2 ln of all scatter of values (n, m) over that within groups: as it is, and at random.

    Sums over independent sets of members say more; the chance of so much is `chance`.
    """
    off = values - values.mean(axis=0)
    gram = off @ off.T
    whole = max(float(np.trace(gram)), np.finfo(float).tiny)
    orders = rng.permuted(np.tile(np.arange(len(off)), (draws, 1)), axis=1)
    orders = np.concatenate([np.arange(len(off))[None], orders])
    within = np.full(len(orders), whole)
    for label in np.unique(labels):
        own = orders[:, labels == label]
        within -= gram[own[:, :, None], own[:, None, :]].sum(axis=(1, 2)) / own.shape[1]
    told = -len(off) / 2 * np.log(np.maximum(within, 1e-12 * whole) / whole)
    return float(told[0]), told[1:]


def ordered(values: np.ndarray, draws: int, rng: np.random.Generator) -> tuple[float, np.ndarray]:
    """n/2 ln of all scatter of values (n, m) over that beside a course in their order; at random.

    Where the order says nothing, values in any other one follow a straight course as well. Sums and
    `chance` as for `between`.
    """
    off = values - values.mean(axis=0)
    gram = off @ off.T
    whole = max(float(np.trace(gram)), np.finfo(float).tiny)
    rank = np.arange(len(off)) - (len(off) - 1) / 2
    course = rank / max(float(np.linalg.norm(rank)), 1.0)
    orders = rng.permuted(np.tile(course, (draws, 1)), axis=1)
    orders = np.concatenate([course[None], orders])
    beside = whole - np.einsum("di,ij,dj->d", orders, gram, orders)
    told = -len(off) / 2 * np.log(np.maximum(beside, 1e-12 * whole) / whole)
    return float(told[0]), told[1:]


def chance(measured: float, shared: np.ndarray) -> float:
    """Of a sum as large as `measured`, from those shared out at random (draws,)."""
    return (1 + int(np.count_nonzero(shared >= measured - 1e-9))) / (1 + len(shared))
