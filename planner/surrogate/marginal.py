"""Marginal likelihood with its own derivative, and the most probable hyperparameters (MAP)."""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.linalg import cho_solve

from planner import jax_setup
from planner.inference.quasi_newton import maximise
from planner.surrogate.gp import Prior
from planner.surrogate.kernels import parse
from planner.surrogate.training_data import Padded

RELATIVE_JITTER = 1e-12  # of the largest prior variance, added to the diagonal
REACH = 4.0  # sds of the prior beyond which nothing is looked for
SUBSET_POINTS = 128  # that are enough to find the neighbourhood of the MAP

_Data = tuple[np.ndarray, tuple[np.ndarray, ...]]


@jax.custom_vjp
def log_marginal(k: Array, y: Array) -> Array:
    """log N(y | 0, k) for k (n, n), y (n,); −∞ where k is not positive definite."""
    return _forward(k, y)[0]


def _forward(k: Array, y: Array) -> tuple[Array, tuple[Array, Array]]:
    factor = jnp.linalg.cholesky(k)
    alpha = cho_solve((factor, True), y)
    value = -0.5 * (y @ alpha + y.shape[0] * jnp.log(2 * jnp.pi))
    value = value - jnp.sum(jnp.log(jnp.diagonal(factor)))
    inverse = cho_solve((factor, True), jnp.eye(y.shape[0]))
    return jnp.where(jnp.isfinite(value), value, -jnp.inf), (inverse, alpha)


def _backward(kept: tuple[Array, Array], slope: Array) -> tuple[Array, Array]:
    # ∂/∂K = ½ (αα⊤ − K⁻¹), Rasmussen & Williams 2006, eq. 5.9: half the work of autodiff
    # through the Cholesky factor, and no loss of accuracy when that is nearly singular.
    inverse, alpha = kept
    grad = jnp.nan_to_num(0.5 * (jnp.outer(alpha, alpha) - inverse))
    return slope * grad, -slope * jnp.nan_to_num(alpha)


log_marginal.defvjp(_forward, _backward)


def _covariance(
    kernel: str, z: Array, x: Array, mask: Array, variance: Array, fixed: Array, mean: Array,
    sd: Array,
) -> Array:  # fmt: skip
    """Covariance (c, c) of the data; entries that do not count are decoupled."""
    theta = mean + sd * z
    k = parse(kernel, x.shape[1]).covariance(jnp, theta, x, x) + fixed
    noise = variance + jnp.exp(2 * theta[1]) + RELATIVE_JITTER * jnp.max(jnp.diagonal(k))
    return k * mask[:, None] * mask[None, :] + jnp.diag(jnp.where(mask > 0, noise, 1.0))


@jax_setup.compiled(static_argnums=0)
def _objective(kernel: str, y: Array, z: Array, *data: Array) -> tuple[Array, Array]:
    def density(z: Array) -> Array:
        return log_marginal(_covariance(kernel, z, *data), y) - 0.5 * jnp.sum(z**2)

    return jax.value_and_grad(density)(z)


@jax_setup.compiled(static_argnums=0)
def _precision(kernel: str, z: Array, *data: Array) -> Array:
    """Fisher information (p, p) of z, the prior's included: ½ tr(K⁻¹ ∂K K⁻¹ ∂K) + 1."""
    factor = jnp.linalg.cholesky(_covariance(kernel, z, *data))
    slopes = jax.jacfwd(lambda z: _covariance(kernel, z, *data))(z)
    solved = jax.vmap(lambda s: cho_solve((factor, True), s), in_axes=2)(slopes)
    return 0.5 * jnp.einsum("iab,jba->ij", solved, solved) + jnp.eye(z.shape[0])


def most_probable(kernel: str, padded: Padded, prior: Prior, output: int) -> np.ndarray:
    """z = (θ − mean)/sd (p,) of one output where prior × likelihood is greatest (MAP).

    L-BFGS from three length scales, one after the other (faster on a CPU than side by side). Of
    more than SUBSET_POINTS points, a subset finds a start for the fit to all of them.
    """
    data = _data(padded, prior, output)
    p = prior.theta_mean.shape[1]
    starts = [np.r_[0.0, 0.0, np.full(p - 2, length)] for length in (0.0, 1.5, -2.0)]
    if len(padded.x) <= SUBSET_POINTS:
        return _climb(kernel, data, starts)
    known = np.flatnonzero(padded.mask[output])
    some = known[np.linspace(0, len(known) - 1, min(SUBSET_POINTS, len(known))).astype(int)]
    return _climb(kernel, data, [_climb(kernel, _part(data, some), starts)], steps=15)


def _climb(kernel: str, data: _Data, starts: list[np.ndarray], steps: int = 200) -> np.ndarray:
    y, rest = data
    return maximise(lambda z: _objective(kernel, y, z, *rest), starts, -REACH, REACH, steps).x


def laplace(kernel: str, padded: Padded, prior: Prior) -> tuple[np.ndarray, np.ndarray]:
    """Centre (m, p) and root (m, p, p), in units of the prior, of Gaussians around the MAP."""
    centres, roots = [], []
    for j in range(len(padded.y)):
        z = most_probable(kernel, padded, prior, j)
        _, data = _data(padded, prior, j)
        covariance = np.linalg.inv(_precision(kernel, z, *data))
        centres.append(z)
        roots.append(np.linalg.cholesky((covariance + covariance.T) / 2))
    return np.array(centres), np.array(roots)


def _part(data: _Data, rows: np.ndarray) -> _Data:
    """Some of the points."""
    y, (x, mask, variance, fixed, mean, sd) = data
    return y[rows], (x[rows], mask[rows], variance[rows], fixed[np.ix_(rows, rows)], mean, sd)


def _data(padded: Padded, prior: Prior, j: int) -> _Data:
    """y (c,) of output j less its prior mean, and what `_covariance` needs."""
    mask = padded.mask[j]
    low = padded.low[j]
    fixed = prior.bias_sd[j] ** 2 + prior.slope_sd[j] ** 2 * np.outer(low, low)
    y = (padded.y[j] - prior.mean[j]) * mask
    variance = np.where(mask > 0, padded.variance[j], 0.0)
    return y, (padded.x, mask, variance, fixed, prior.theta_mean[j], prior.theta_sd[j])
