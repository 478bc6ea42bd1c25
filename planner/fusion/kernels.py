"""Kernels as pure functions of two sets of points, with unit variance.

Each takes the array library (numpy or jax.numpy), xa (…, a, d), xb (…, b, d) already divided by
the length scales, and returns (…, a, b). Sums and products of kernels are sums and products of
these arrays (Rasmussen & Williams 2006, chapter 4).
"""

from collections.abc import Callable
from typing import Any

import numpy as np

Kernel = Callable[[Any, Any, Any], Any]


def _squared_distance(xp: Any, xa: Any, xb: Any) -> Any:
    if xp is np:
        # One matrix product. Cancellation leaves an error of 1e-16 |x|² in r²; the kernels are
        # smooth functions of r², so it stays that small.
        own_a, own_b = np.sum(xa**2, axis=-1), np.sum(xb**2, axis=-1)
        product = xa @ np.swapaxes(xb, -1, -2)
        return np.maximum(own_a[..., :, None] + own_b[..., None, :] - 2 * product, 0.0)
    total = 0.0  # small batched products are slow in XLA; differences fuse
    for i in range(xa.shape[-1]):
        total = total + (xa[..., :, None, i] - xb[..., None, :, i]) ** 2
    return total


def bias(xp: Any, xa: Any, xb: Any) -> Any:
    """Constant (seed 000, eq. 8)."""
    return xp.ones_like(xa[..., :, None, 0] * xb[..., None, :, 0])


def linear(xp: Any, xa: Any, xb: Any) -> Any:
    """x·x' (seed 000, eq. 4)."""
    return xa @ xp.swapaxes(xb, -1, -2)


def quadratic(xp: Any, xa: Any, xb: Any) -> Any:
    """Square of the linear kernel (seed 000, eq. 5)."""
    return linear(xp, xa, xb) ** 2


def cubic(xp: Any, xa: Any, xb: Any) -> Any:
    """Cube of the linear kernel (seed 000, eq. 6)."""
    return linear(xp, xa, xb) ** 3


def rbf(xp: Any, xa: Any, xb: Any) -> Any:
    """exp(−r²/2) (seed 000, eq. 7)."""
    return xp.exp(-_squared_distance(xp, xa, xb) / 2)


def _distance(xp: Any, xa: Any, xb: Any) -> Any:
    squared = _squared_distance(xp, xa, xb)
    if xp is np:
        return np.sqrt(squared)
    # √ has no slope at 0, so gradients there would be undefined.
    return xp.sqrt(xp.where(squared == 0, 1.0, squared)) * (squared != 0)  # NaN stays NaN


def matern32(xp: Any, xa: Any, xb: Any) -> Any:
    """Matérn 3/2."""
    r = 3.0**0.5 * _distance(xp, xa, xb)
    return (1 + r) * xp.exp(-r)


def matern52(xp: Any, xa: Any, xb: Any) -> Any:
    """Matérn 5/2."""
    r = 5.0**0.5 * _distance(xp, xa, xb)
    return (1 + r * (1 + r / 3)) * xp.exp(-r)


KERNELS: dict[str, Kernel] = {
    "bias": bias,
    "linear": linear,
    "quadratic": quadratic,
    "cubic": cubic,
    "rbf": rbf,
    "matern32": matern32,
    "matern52": matern52,
}
