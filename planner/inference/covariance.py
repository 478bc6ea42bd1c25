"""Covariances of what is known by a precision, and their roots."""

import numpy as np


def inverse(precision: np.ndarray) -> np.ndarray:
    """Covariance (p, p) of a precision that is positive, but for rounding: so is the answer.

    Where a barrier stands close, entries differ by so many decades that a plain inverse loses it.
    """
    unit = 1 / np.sqrt(np.diagonal(precision))
    values, vectors = eigen(precision * np.outer(unit, unit))
    values = np.maximum(values, np.finfo(float).eps * len(unit) * values[-1])
    return np.outer(unit, unit) * ((vectors / values) @ vectors.T)


def covariance_root(covariance: np.ndarray) -> np.ndarray:
    """R = Rᵀ (p, p) with R Rᵀ a covariance that is positive, but for rounding.

    The symmetric root is the one that hangs on no eigenvector's sign: what is drawn with it stays
    the same to rounding.
    """
    values, vectors = eigen(covariance)
    return vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T


def eigen(symmetric: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (…, p), rising, and eigenvectors (…, p, p) of symmetric matrices (…, p, p).

    Raises LinAlgError where they are not finite.
    """
    try:
        return np.linalg.eigh(symmetric)
    except np.linalg.LinAlgError:
        if not np.isfinite(symmetric).all():
            raise
    # Divide and conquer once failed for a precision of 178 numbers whose condition was 2e4; robust
    # representations find it. SciPy is loaded here alone, as it takes 0.6 s.
    from scipy.linalg import eigh

    shape = symmetric.shape
    found = [eigh(one) for one in symmetric.reshape(-1, *shape[-2:])]
    values, vectors = (np.array(each) for each in zip(*found, strict=True))
    return values.reshape(shape[:-1]), vectors.reshape(shape)
