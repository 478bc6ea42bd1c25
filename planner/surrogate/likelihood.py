"""Likelihood of data under a GP by JAX: at many hyperparameters, and their most probable values."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.linalg import cho_solve

from planner import jax_setup
from planner.surrogate.training_data import Padded, Prior, data_covariance

# Likelihoods, and elements of their covariances, that are worked out together: whatever is asked of
# so many points is compiled once, and stays in the cache.
BATCH, ELEMENTS = 256, 2**20
REACH = 4.0  # sds of the prior beyond which nothing is looked for
SUBSET_POINTS = 128  # that are enough to find the neighbourhood of the MAP
JITTER = 1e-12  # of the prior variance, added where the MAP is looked for

LogDensity = Callable[[np.ndarray], tuple[float, np.ndarray]]

# Stands for the objective where it is not finite, as beyond a failed Cholesky factor: larger than
# any −log density met, yet finite, so that the line search comes back by a shorter step.
INFEASIBLE = 1e10
RELATIVE_TOLERANCE = 2.22e-9  # scipy's default: 1e7 times the rounding of a double
_Data = tuple[np.ndarray, ...]  # x (c, d), y, low, mask, variance (c,), sds of b and ρ'


@jax.custom_vjp
def log_marginal(k: Array, y: Array) -> Array:
    """log N(y | 0, k) for k (n, n), y (n,), without the constant; −∞ where k is singular."""
    return _forward(k, y)[0]


def _forward(k: Array, y: Array) -> tuple[Array, tuple[Array, Array]]:
    factor = jnp.linalg.cholesky(k)
    alpha = cho_solve((factor, True), y)
    value = -0.5 * y @ alpha - jnp.sum(jnp.log(jnp.diagonal(factor)))
    inverse = cho_solve((factor, True), jnp.eye(y.shape[0]))
    return jnp.where(jnp.isfinite(value), value, -jnp.inf), (inverse, alpha)


def _backward(kept: tuple[Array, Array], slope: Array) -> tuple[Array, Array]:
    # ∂/∂K = ½ (αα⊤ − K⁻¹), Rasmussen & Williams 2006, eq. 5.9: half the work of autodiff
    # through the Cholesky factor, and no loss of accuracy when that is nearly singular.
    inverse, alpha = kept
    grad = jnp.nan_to_num(0.5 * (jnp.outer(alpha, alpha) - inverse))
    return slope * grad, -slope * jnp.nan_to_num(alpha)


log_marginal.defvjp(_forward, _backward)


def log_likelihoods(
    kernel: str, data: Padded, prior: Prior, jitter: float, theta: np.ndarray
) -> np.ndarray:
    """(m, s) of all outputs at θ (m, s, p), without the constant; −∞ where there is none."""
    m, samples, p = theta.shape
    outputs = _outputs(data, prior)
    batch = max(1, min(BATCH, ELEMENTS // outputs[1].shape[1] ** 2))
    order = np.arange(-(-m * samples // batch) * batch).clip(max=m * samples - 1)
    flat, found = theta.reshape(-1, p), []
    for some in order.reshape(-1, batch):
        own = (values[some // samples] for values in outputs)
        found.append(_likelihoods(kernel, jitter, flat[some], *own))
    return np.concatenate(found)[: m * samples].reshape(m, samples)


@jax_setup.compiled("quick", static_argnums=0)
def _likelihoods(kernel: str, jitter: float, theta: Array, *data: Array) -> Array:
    """(s,) at θ (s, p), each with data of its own."""
    return jax.vmap(partial(_likelihood, kernel, jitter))(theta, *data)


def _likelihood(
    kernel: str, jitter: float, theta: Array, x: Array, y: Array, *rest: Array
) -> Array:
    return log_marginal(data_covariance(jnp, kernel, theta, jitter, x, *rest), y)


def laplace(kernel: str, padded: Padded, prior: Prior) -> tuple[np.ndarray, np.ndarray]:
    """Centre (m, p) and root (m, p, p), in units of the prior, of Gaussians around the MAP."""
    centres, roots = [], []
    for data, mean, sd in zip(
        zip(*_outputs(padded, prior), strict=True), prior.theta_mean, prior.theta_sd, strict=True
    ):
        z = _most_probable(kernel, data, mean, sd)
        covariance = np.linalg.inv(_precision(kernel, z, mean, sd, data[0], *data[2:]))
        centres.append(z)
        roots.append(np.linalg.cholesky((covariance + covariance.T) / 2))
    return np.array(centres), np.array(roots)


def _outputs(data: Padded, prior: Prior) -> _Data:
    """Of all outputs (m, …): x, y less the prior mean, and what `data_covariance` needs."""
    m = len(data.y)
    y = (data.y - prior.mean[:, None]) * data.mask
    x = np.broadcast_to(data.x, (m, *data.x.shape[-2:]))
    return x, y, data.low, data.mask, data.variance, prior.bias_sd, prior.slope_sd


def _most_probable(kernel: str, data: _Data, mean: np.ndarray, sd: np.ndarray) -> np.ndarray:
    """z = (θ − mean)/sd (p,) of one output where prior × likelihood is greatest (MAP).

    L-BFGS from three length scales, one after the other (faster on a CPU than side by side). Of
    more than SUBSET_POINTS points, a subset finds a start for the fit to all of them.
    """

    def climb(data: _Data, starts: list[np.ndarray], steps: int = 200) -> np.ndarray:
        def density(z: np.ndarray) -> tuple[float, np.ndarray]:
            value, slope = log_likelihood(kernel, mean + sd * z, JITTER, *data)
            return float(value) - 0.5 * float(z @ z), sd * slope - z

        return maximise(density, starts, -REACH, REACH, steps).x

    starts = [np.r_[0.0, 0.0, np.full(len(mean) - 2, length)] for length in (0.0, 1.5, -2.0)]
    if len(data[0]) <= SUBSET_POINTS:
        return climb(data, starts)
    known = np.flatnonzero(data[3])
    some = known[np.linspace(0, len(known) - 1, min(SUBSET_POINTS, len(known))).astype(int)]
    part = *(values[some] for values in data[:5]), *data[5:]
    return climb(data, [climb(part, starts)], steps=15)


@jax_setup.compiled(static_argnums=0)
def log_likelihood(kernel: str, theta: Array, jitter: float, *data: Array) -> tuple[Array, Array]:
    """Of one output's data at θ (p,), without the constant, and its slope in θ."""
    return jax.value_and_grad(lambda theta: _likelihood(kernel, jitter, theta, *data))(theta)


@jax_setup.compiled(static_argnums=0)
def _precision(kernel: str, z: Array, mean: Array, sd: Array, *data: Array) -> Array:
    """Fisher information (p, p) of z, the prior's included: ½ tr(K⁻¹ ∂K K⁻¹ ∂K) + 1."""

    def covariance(z: Array) -> Array:
        return data_covariance(jnp, kernel, mean + sd * z, JITTER, *data)

    factor, slopes = jnp.linalg.cholesky(covariance(z)), jax.jacfwd(covariance)(z)
    solved = jax.vmap(lambda s: cho_solve((factor, True), s), in_axes=2)(slopes)
    return 0.5 * jnp.einsum("iab,jba->ij", solved, solved) + jnp.eye(z.shape[0])


@dataclass(frozen=True, eq=False)
class Peak:
    """The highest point found: x (p,) and the log density there (−∞ if none was finite)."""

    x: np.ndarray
    log_density: float


def maximise(
    log_density: LogDensity,
    starts: Sequence[np.ndarray],
    lower: float | np.ndarray,
    upper: float | np.ndarray,
    most_steps: int = 200,
    relative_tolerance: float = RELATIVE_TOLERANCE,
) -> Peak:
    """The best end of L-BFGS-B (Byrd et al. 1995) from each of `starts`.

    Args:
        log_density: maps x (p,) to the log density and its gradient (p,); where either is not
            finite, x is infeasible and the step is shortened. jax arrays may be returned.
        starts: points (p,) to begin at, one at least.
        lower, upper: bounds of the entries of x, one for all or (p,).
        most_steps: iterations from each start.
        relative_tolerance: an iteration that gains less than this share of the log density is the
            last.

    Returns:
        The highest end; the first start with −∞ where the log density was nowhere finite.
    """
    from scipy.optimize import minimize  # 0.6 s, which few poses do not need

    def negative(x: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = log_density(x)
        value, slope = float(value), np.array(slope, dtype=float)
        if not (np.isfinite(value) and np.isfinite(slope).all()):
            return INFEASIBLE, np.zeros(len(x))
        return -value, -slope

    ones = np.ones(len(starts[0]))
    bounds = list(zip(lower * ones, upper * ones, strict=True))
    best = Peak(np.asarray(starts[0]), -np.inf)
    for start in starts:
        how = {"maxiter": most_steps, "ftol": relative_tolerance}
        done = minimize(negative, start, jac=True, method="L-BFGS-B", bounds=bounds, options=how)
        if done.fun < min(INFEASIBLE, -best.log_density):
            best = Peak(done.x, -float(done.fun))
    return best
