"""Lower triangular matrices: half of them is 0, which takes no time."""

import numpy as np
from scipy.linalg.lapack import dtrtri

BAND = 128  # rows that are multiplied together


def inverse(lower: np.ndarray) -> np.ndarray:
    """Of a Cholesky factor (n, n)."""
    # In LAPACK's order of rows and columns the transpose is at hand without a copy.
    return dtrtri(lower.T, lower=False)[0].T


def times(lower: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Product (k, n, q) of matrices (k, n, n) and columns (k, n, q)."""
    count = lower.shape[1]
    if count <= BAND:
        return lower @ columns
    out = np.empty(columns.shape)
    for start in range(0, count, BAND):
        rows, before = slice(start, min(start + BAND, count)), slice(min(start + BAND, count))
        np.matmul(lower[:, rows, before], columns[:, before], out=out[:, rows])
    return out
