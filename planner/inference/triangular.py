"""Lower triangular matrices: half of them is 0, which takes no time.

By NumPy alone: SciPy's linear algebra takes 0.2 s to import, more than most commands need it for.
"""

import numpy as np

BAND = 128  # rows that are multiplied together
BLOCK = 32  # rows up to which a general inverse costs less than halving them once more


def inverse(lower: np.ndarray) -> np.ndarray:
    """Of a Cholesky factor (n, n)."""
    out = np.zeros(lower.shape)
    _invert(lower, out)
    return out


def _invert(lower: np.ndarray, out: np.ndarray) -> None:
    count = len(lower)
    if count <= BLOCK:
        out[:] = np.tril(np.linalg.inv(lower))
        return
    half = count // 2
    first, last = slice(half), slice(half, None)
    _invert(lower[first, first], out[first, first])
    _invert(lower[last, last], out[last, last])
    out[last, first] = -out[last, last] @ (lower[last, first] @ out[first, first])


def solve(lower: np.ndarray, right: np.ndarray) -> np.ndarray:
    """x of L Lᵀ x = right (n,), for a Cholesky factor L (n, n)."""
    whiten = inverse(lower)
    return whiten.T @ (whiten @ right)


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
