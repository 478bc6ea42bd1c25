"""Covariances of what is known by a precision, and their roots.

By SciPy's eigenvalues: NumPy's, by divide and conquer, did not converge for a precision of 178
numbers whose condition was 2e4.
"""

import numpy as np
from scipy.linalg import eigh


def inverse(precision: np.ndarray) -> np.ndarray:
    """Covariance (p, p) of a precision that is positive, but for rounding: so is the answer.

    Where a barrier stands close, entries differ by so many decades that a plain inverse loses it.
    """
    unit = 1 / np.sqrt(np.diagonal(precision))
    values, vectors = eigh(precision * np.outer(unit, unit))
    values = np.maximum(values, np.finfo(float).eps * len(unit) * values[-1])
    return np.outer(unit, unit) * ((vectors / values) @ vectors.T)


def covariance_root(covariance: np.ndarray) -> np.ndarray:
    """R (p, p) with R Rᵀ a covariance that is positive, but for rounding."""
    values, vectors = eigh(covariance)
    return vectors * np.sqrt(np.maximum(values, 0.0))
