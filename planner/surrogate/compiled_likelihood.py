"""The likelihood of many poses or outputs at many hyperparameters, compiled."""

import jax
import jax.numpy as jnp
from jax import Array
from jax.scipy.linalg import solve_triangular

from planner import jax_setup
from planner.surrogate.data_covariance import data_covariance


@jax_setup.compiled("quick", static_argnums=0)
def compiled_log_likelihoods(
    kernel: str, x: Array, y: Array, low: Array, mask: Array, variance: Array, bias: Array,
    slope: Array, jitter: Array, theta: Array,
) -> Array:  # fmt: skip
    """(m, s) of y (m, c) at x (m, c, d) and θ (m, s, p), as `likelihood.log_likelihoods`."""

    def one(x: Array, y: Array, low: Array, mask: Array, variance: Array, bias: Array,
            slope: Array, theta: Array) -> Array:  # fmt: skip
        k = data_covariance(jnp, kernel, x, low, mask, variance, bias, slope, jitter, theta)
        factor = jnp.linalg.cholesky(k)
        white = solve_triangular(factor, y, lower=True)
        value = -0.5 * jnp.sum(white**2) - jnp.sum(jnp.log(jnp.diagonal(factor)))
        return jnp.where(jnp.isfinite(value), value, -jnp.inf)

    of_an_output = jax.vmap(one, in_axes=(None,) * 7 + (0,))
    return jax.vmap(of_an_output)(x, y, low, mask, variance, bias, slope, theta)
