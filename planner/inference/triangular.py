"""Lower triangular matrices: half of them is 0, which takes no time.

By NumPy alone: SciPy's linear algebra takes 0.2 s to import, more than most commands need it for.
"""

import numpy as np

BAND = 128  # rows that are divided by together
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


def in_bands(lower: np.ndarray) -> np.ndarray:
    """Cholesky factors (k, n, n) with the blocks of BAND rows on their diagonals inverted.

    To divide by the factors then takes no longer than to multiply by their inverses, which are
    not needed for it. Of the first rows and columns alone it is what it is of these.
    """
    out = lower.copy()
    for rows in _bands(lower.shape[1]):
        out[:, rows, rows] = [inverse(one) for one in lower[:, rows, rows]]
    return out


def divided(bands: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """L⁻¹ columns (k, n, q) of factors `in_bands` (k, n, n)."""
    out = np.empty(columns.shape)
    for rows in _bands(bands.shape[1]):
        before, right = slice(rows.start), columns[:, rows]
        if rows.start:
            right = right - bands[:, rows, before] @ out[:, before]
        np.matmul(bands[:, rows, rows], right, out=out[:, rows])
    return out


def divided_by_transposed(bands: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """L⁻ᵀ columns (k, n, q)."""
    out = np.empty(columns.shape)
    for rows in reversed(_bands(bands.shape[1])):
        after, right = slice(rows.stop, None), columns[:, rows]
        if rows.stop < bands.shape[1]:
            right = right - np.swapaxes(bands[:, after, rows], 1, 2) @ out[:, after]
        np.matmul(np.swapaxes(bands[:, rows, rows], 1, 2), right, out=out[:, rows])
    return out


def inverses(bands: np.ndarray) -> np.ndarray:
    """L⁻¹ (k, n, n)."""
    out = np.zeros(bands.shape)
    for rows in _bands(bands.shape[1]):
        before, own = slice(rows.start), bands[:, rows, rows]
        out[:, rows, rows] = own
        if rows.start:
            out[:, rows, before] = -own @ (bands[:, rows, before] @ out[:, before, before])
    return out


def _bands(count: int) -> list[slice]:
    return [slice(start, min(start + BAND, count)) for start in range(0, count, BAND)]
