"""Squared posterior covariances of many candidates with a target, summed up, by JAX."""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from planner import jax_setup
from planner.surrogate.kernels import parse
from planner.surrogate.training_data import capacity

BLOCK = 128  # candidates at a time: their covariances with the target stay in the cache


def squared_covariances(
    kernel: str, precision: type[np.floating], thetas: np.ndarray, x: np.ndarray, a: np.ndarray,
    xu: np.ndarray, b: np.ndarray, weight: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Σ_u weight_u cov(c, u)² (s, n) at θ (s, p) of n candidates c with the target's points u.

    The covariance is the kernel of x (n, d) and xu (u, d), and the inner product of features
    a (s, n, r) and b (s, u, r). Both n and r are filled up, so that little is compiled.
    """
    (n, _), r = x.shape, a.shape[2]
    rows, features = (0, -n % BLOCK), (0, capacity(r) - r)
    x = np.pad(x, [rows, (0, 0)]).astype(precision)
    a = np.pad(a, [(0, 0), rows, features]).astype(precision)
    b = np.pad(b, [(0, 0), (0, 0), features]).astype(precision)
    thetas, xu, weight = (one.astype(precision) for one in (thetas, xu, weight))
    blocks = (slice(i, i + BLOCK) for i in range(0, len(x), BLOCK))
    done = [_of_block(kernel, thetas, x[i], a[:, i], xu, b, weight) for i in blocks]
    return np.concatenate(done, axis=1)[:, :n].astype(float)


@jax_setup.compiled("wide", static_argnums=0)
def _of_block(
    kernel: str, thetas: Array, x: Array, a: Array, xu: Array, b: Array, weight: Array
) -> Array:
    delta = parse(kernel, x.shape[1])

    def one(sample: tuple[Array, Array, Array]) -> Array:
        theta, own, there = sample
        return (delta.covariance(jnp, theta, x, xu) + own @ there.T) ** 2 @ weight

    return jax.lax.map(one, (thetas, a, b))
