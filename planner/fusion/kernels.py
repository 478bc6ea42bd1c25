"""Kernels as pure functions of two sets of points, with unit variance.

Each takes xa (a, d), xb (b, d) and length scales (d,), and returns (a, b). Sums and products of
kernels are sums and products of these arrays (Rasmussen & Williams 2006, chapter 4).
"""

from collections.abc import Callable

import jax.numpy as jnp
from jax import Array

from planner.fusion import jaxsetup  # noqa: F401

Kernel = Callable[[Array, Array, Array], Array]


def _squared_distance(xa: Array, xb: Array, scale: Array) -> Array:
    a, b = xa / scale[None, :], xb / scale[None, :]
    # Differences, not |a|² + |b|² − 2ab: cancellation would leave near points at distance 0.
    return jnp.sum((a[:, None, :] - b[None, :, :]) ** 2, axis=-1)


def bias(xa: Array, xb: Array, scale: Array) -> Array:
    """Constant (seed 000, eq. 8)."""
    return jnp.ones((xa.shape[0], xb.shape[0]))


def linear(xa: Array, xb: Array, scale: Array) -> Array:
    """x·x' (seed 000, eq. 4)."""
    return (xa / scale[None, :]) @ (xb / scale[None, :]).T


def quadratic(xa: Array, xb: Array, scale: Array) -> Array:
    """Square of the linear kernel (seed 000, eq. 5)."""
    return linear(xa, xb, scale) ** 2


def cubic(xa: Array, xb: Array, scale: Array) -> Array:
    """Cube of the linear kernel (seed 000, eq. 6)."""
    return linear(xa, xb, scale) ** 3


def rbf(xa: Array, xb: Array, scale: Array) -> Array:
    """exp(−r²/2) (seed 000, eq. 7)."""
    return jnp.exp(-_squared_distance(xa, xb, scale) / 2)


def _distance(xa: Array, xb: Array, scale: Array) -> Array:
    squared = _squared_distance(xa, xb, scale)
    # √ has no slope at 0, so gradients there would be undefined.
    return jnp.sqrt(jnp.where(squared > 0, squared, 1.0)) * (squared > 0)


def matern32(xa: Array, xb: Array, scale: Array) -> Array:
    """Matérn 3/2."""
    r = jnp.sqrt(3.0) * _distance(xa, xb, scale)
    return (1 + r) * jnp.exp(-r)


def matern52(xa: Array, xb: Array, scale: Array) -> Array:
    """Matérn 5/2."""
    r = jnp.sqrt(5.0) * _distance(xa, xb, scale)
    return (1 + r + r**2 / 3) * jnp.exp(-r)


KERNELS: dict[str, Kernel] = {
    "bias": bias,
    "linear": linear,
    "quadratic": quadratic,
    "cubic": cubic,
    "rbf": rbf,
    "matern32": matern32,
    "matern52": matern52,
}
