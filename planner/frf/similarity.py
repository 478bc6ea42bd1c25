"""How alike two sets of FRFs are: Global FRAC and Frobenius similarity (seed 004, appendix B)."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Similarity:
    """Both in [0, 1], 1 where the magnitudes agree (FRAC: up to a factor)."""

    frac: float
    frobenius: float


def similarity(measured: np.ndarray, simulated: np.ndarray) -> Similarity:
    """Of FRFs (n, 3, 3, F) of n positions: response by hit axis by line, over magnitudes.

    The FRF of a position and a hit axis is the vector of its three responses, one after another:
    responses that vanish by symmetry, and are noise, then weigh as little as they are. Hit axes
    and lines that were not measured (NaN) are left out. NaN if nothing was.
    """
    given = np.isfinite(measured)
    a = np.where(given, np.abs(measured), 0.0)
    b = np.where(given, np.abs(simulated), 0.0)
    cross, aa, bb = (np.sum(x, axis=(1, 3)) for x in (a * b, a * a, b * b))  # (n, hit axis)
    there = aa > 0
    if not there.any():
        return Similarity(float("nan"), float("nan"))
    frac = np.divide(cross**2, aa * bb, out=np.zeros_like(cross), where=there & (bb > 0))
    axes = there.any(axis=0)
    per_axis = np.sum(frac, axis=0)[axes] / np.sum(there, axis=0)[axes]
    error = np.sqrt(np.sum((a - b) ** 2, axis=(0, 1, 3))[axes] / np.sum(aa, axis=0)[axes])
    return Similarity(float(np.mean(per_axis)), float(np.mean(np.maximum(0.0, 1 - error))))
