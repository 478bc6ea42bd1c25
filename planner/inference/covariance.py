"""Covariances of what is known by a precision."""

import numpy as np


def inverse(precision: np.ndarray) -> np.ndarray:
    """Covariance (p, p) of a precision that is positive, but for rounding: so is the answer.

    Where a barrier stands close, entries differ by so many decades that a plain inverse loses it.
    """
    unit = 1 / np.sqrt(np.diagonal(precision))
    values, vectors = np.linalg.eigh(precision * np.outer(unit, unit))
    values = np.maximum(values, np.finfo(float).eps * len(unit) * values[-1])
    return np.outer(unit, unit) * ((vectors / values) @ vectors.T)
