"""Squared posterior covariances of many candidates with a target, compiled."""

import jax
import jax.numpy as jnp
from jax import Array

from planner import jax_setup
from planner.design.squared_covariances import BLOCK_CANDIDATES
from planner.surrogate.kernels import parse


@jax_setup.compiled("wide", static_argnums=0)
def compiled_squared_covariances(
    kernel: str, theta: Array, x: Array, a: Array, xu: Array, b: Array, weight: Array
) -> Array:
    """Σ_u weight_u cov(c, u)² of candidates c, block by block."""
    delta = parse(kernel, x.shape[1])

    def block(one: tuple[Array, Array]) -> Array:
        xc, ac = one
        return (delta.covariance(jnp, theta, xc, xu) + ac @ b.T) ** 2 @ weight

    blocks = (
        x.reshape(-1, BLOCK_CANDIDATES, x.shape[1]),
        a.reshape(-1, BLOCK_CANDIDATES, a.shape[1]),
    )
    return jax.lax.map(block, blocks).reshape(-1)
