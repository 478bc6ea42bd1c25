"""By how much whole rows of a matrix err: hits beside their place, tilted, other sensors' mounts.

A row's own scale cannot be told from its point's motion, except at points that are columns too:
there the row says how the point moves and so does the column. Rows are taken to err alike.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from planner.modal.rank_one_fit import FittedShape

FREE_GAIN = 0.2  # sd that leaves a row's gain to what is measured
LEAST_SD = 0.002  # of a gain in one mode: residues agree no better than this
# Student's t over the normal quantile, both at 97.5 %, by degrees of freedom. One degree would give
# 6.5, which would call every shape unknown.
STUDENT = (2.2, 2.2, 1.62, 1.42, 1.31)


def row_gain(shapes: Sequence[FittedShape]) -> float:
    """Relative sd of rows' gains for intervals of 95 %, from shapes fitted with gains left free."""
    tied = shapes[0].tied.size
    common = own = count = 0.0
    for i, j in combinations(range(tied), 2):
        found = _difference(shapes, i, j)
        if found is not None:
            common, own, count = common + found[0], own + found[1], count + 1
    if not count:
        return 0.0
    student = STUDENT[min(tied - 2, len(STUDENT) - 1)]
    return float(np.sqrt(student**2 * common / count + own / count))


def _difference(shapes: Sequence[FittedShape], i: int, j: int) -> tuple[float, float] | None:
    """Variance of a gain: what all modes have in common, and what is each mode's own."""
    apart = np.array([np.real(s.gains[i] - s.gains[j]) for s in shapes])
    variance = [
        s.gain_covariance[i, i] + s.gain_covariance[j, j] - 2 * s.gain_covariance[i, j]
        for s in shapes
    ]
    prior = 1 / (2 * FREE_GAIN**2)
    known = 1 / np.maximum(variance, 1e-300) - prior
    kept = known > prior
    if not kept.any():
        return None
    # The prior draws a difference towards zero; what was measured does not.
    apart = apart[kept] * (known[kept] + prior) / known[kept]
    noise = 1 / known[kept] + LEAST_SD**2
    weight = 1 / noise
    mean, total = np.sum(weight * apart) / np.sum(weight), np.sum(weight)
    beyond = np.sum(weight * (apart - mean) ** 2) - (kept.sum() - 1)
    scale = total - np.sum(weight**2) / total
    own = max(0.0, beyond / scale) if kept.sum() > 1 and scale > 0 else 0.0
    weight = 1 / (noise + own)
    mean = np.sum(weight * apart) / np.sum(weight)
    return max(0.0, mean**2 - 1 / np.sum(weight)) / 2, own / 2
