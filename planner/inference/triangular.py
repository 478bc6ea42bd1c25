"""Lower triangular matrices: half of them is 0, which takes no time.

By NumPy alone: SciPy's linear algebra takes 0.2 s to import, more than most commands need it for.
"""

import numpy as np

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
