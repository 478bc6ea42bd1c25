"""Gaussian processes of many outputs, averaged over hyperparameters, in one compiled function.

Per output: y = mean + ρ'·h + b + δ(x) + ε, where h is the centred low fidelity, ρ' = ρ − 1 and b
have Gaussian priors that are marginalised exactly as kernel terms, δ is a zero-mean GP, and ε has
the measurement's own variance plus a nugget. The hyperparameters θ = (log σ, log τ, log ℓ_1…d)
are averaged: samples from the prior, then from a Gaussian around what the data favour, weighted
by prior × marginal likelihood over the mixture they came from (deterministic mixture weights,
Owen & Zhou 2000), then resampled to a few of equal weight.
"""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.linalg import cho_solve, solve_triangular
from scipy.stats import norm, qmc

from planner.fusion import jaxsetup  # noqa: F401
from planner.fusion.data import Padded, query_size
from planner.fusion.kernels import KERNELS

INFLATION = 1.4  # of the second stage's spread, so that tails are sampled too
JITTERS = (1e-10, 1e-8, 1e-6)  # relative to the prior variance


@dataclass(frozen=True, eq=False)
class Prior:
    """Prior of m outputs: mean (m,), sd of b and ρ' (m,), θ's mean and sd (m, 2 + d)."""

    mean: np.ndarray
    bias_sd: np.ndarray
    slope_sd: np.ndarray
    theta_mean: np.ndarray
    theta_sd: np.ndarray


@dataclass(frozen=True, eq=False)
class Posterior:
    """m outputs, k hyperparameter samples of equal weight, c padded training points."""

    x: Array  # (c, d)
    low: Array  # (m, c) centred
    mask: Array  # (m, c)
    theta: Array  # (m, k, 2 + d)
    factor: Array  # (m, k, c, c) lower Cholesky factor
    weights: Array  # (m, k, c) K⁻¹(y − mean)
    prior: Prior
    kernel: str
    remarks: tuple[str, ...] = ()

    def predict(self, x: np.ndarray, low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, m) of the outputs, noise-free, at x (q, d) with centred low (q, m)."""
        n = len(x)
        size = query_size(n)
        xq = np.zeros((size, x.shape[1]))
        lq = np.zeros((self.mask.shape[0], size))
        xq[:n], lq[:, :n] = x, low.T
        mean, variance = _predict(
            self.kernel, self.x, self.low, self.mask, self.theta, self.factor, self.weights,
            self.prior.bias_sd, self.prior.slope_sd, xq, lq,
        )  # fmt: skip
        centre = self.prior.mean[None, :]
        return np.array(mean).T[:n] + centre, np.sqrt(np.array(variance).T[:n])

    def nugget_variance(self) -> np.ndarray:
        """Mean nugget variance (m,)."""
        return np.array(jnp.mean(jnp.exp(2 * self.theta[:, :, 1]), axis=1))


def fit(
    padded: Padded, prior: Prior, samples: int = 256, kept: int = 32, kernel: str = "matern52"
) -> Posterior:
    """Posterior of all outputs; y and low of `padded` as they are, prior mean taken off here."""
    p = prior.theta_mean.shape[1]
    first, second = normal_points(samples, p)
    y = (padded.y - prior.mean[:, None]) * padded.mask
    remarks: tuple[str, ...] = ()
    for jitter in JITTERS:
        theta, factor, weights = _fit(
            kernel, kept, padded.x, padded.low, padded.mask, y, padded.variance,
            prior.bias_sd, prior.slope_sd, prior.theta_mean, prior.theta_sd, first, second, jitter,
        )  # fmt: skip
        if bool(jnp.all(jnp.isfinite(weights))):
            break
        remarks = (f"The covariance was singular; a jitter above {jitter:g} was needed.",)
    return Posterior(
        jnp.asarray(padded.x), jnp.asarray(padded.low), jnp.asarray(padded.mask), theta, factor,
        weights, prior, kernel, remarks,
    )  # fmt: skip


def normal_points(samples: int, p: int) -> tuple[np.ndarray, np.ndarray]:
    """Two sets (samples, p) of quasi-random standard normal points, the same every time."""
    sets = []
    for seed in (1, 2):
        sobol = qmc.Sobol(p, scramble=True, rng=np.random.default_rng(seed))
        unit = sobol.random_base2(int(np.ceil(np.log2(samples))))[:samples]
        sets.append(norm.ppf(np.clip(unit, 1e-6, 1 - 1e-6)))
    return sets[0], sets[1]


def _covariance(
    kernel: str, xa: Array, la: Array, xb: Array, lb: Array, theta: Array, bias: Array, slope: Array
) -> Array:
    """Prior covariance (a, b) of one output at one θ."""
    delta = jnp.exp(2 * theta[0]) * KERNELS[kernel](xa, xb, jnp.exp(theta[2:]))
    return delta + bias**2 + slope**2 * la[:, None] * lb[None, :]


def _own_variance(
    kernel: str, x: Array, low: Array, theta: Array, bias: Array, slope: Array
) -> Array:
    """Diagonal (a,) of the prior covariance."""
    scale = jnp.exp(theta[2:])
    delta = jax.vmap(lambda p: KERNELS[kernel](p[None, :], p[None, :], scale)[0, 0])(x)
    return jnp.exp(2 * theta[0]) * delta + bias**2 + slope**2 * low**2


def _factor(
    kernel: str, x: Array, low: Array, mask: Array, variance: Array, theta: Array, bias: Array,
    slope: Array, jitter: float | Array,
) -> Array:  # fmt: skip
    """Cholesky factor (c, c); entries that do not count are decoupled with unit variance."""
    both = mask[:, None] * mask[None, :]
    k = _covariance(kernel, x, low, x, low, theta, bias, slope) * both
    noise = variance + jnp.exp(2 * theta[1]) + jitter * (jnp.exp(2 * theta[0]) + bias**2)
    return jnp.linalg.cholesky(k + jnp.diag(jnp.where(mask > 0, noise, 1.0)))


def _log_likelihood(
    kernel: str, x: Array, low: Array, mask: Array, y: Array, variance: Array, bias: Array,
    slope: Array, jitter: float | Array, theta: Array,
) -> Array:  # fmt: skip
    factor = _factor(kernel, x, low, mask, variance, theta, bias, slope, jitter)
    white = solve_triangular(factor, y, lower=True)
    value = -0.5 * jnp.sum(white**2) - jnp.sum(jnp.log(jnp.diagonal(factor)))
    return jnp.where(jnp.isfinite(value), value, -jnp.inf)


def _log_normal(z: Array) -> Array:
    return -0.5 * jnp.sum(z**2, axis=-1)


@partial(jax.jit, static_argnums=(0, 1))
def _fit(
    kernel: str, kept: int, x: Array, low: Array, mask: Array, y: Array, variance: Array,
    bias: Array, slope: Array, mean: Array, sd: Array, first: Array, second: Array, jitter: Array,
) -> tuple[Array, Array, Array]:  # fmt: skip
    def one(low, mask, y, variance, bias, slope, mean, sd):
        score = partial(_log_likelihood, kernel, x, low, mask, y, variance, bias, slope, jitter)
        z = _sample(lambda z: score(mean + sd * z), first, second, kept)
        theta = mean[None, :] + sd[None, :] * z
        factors = jax.vmap(
            lambda t: _factor(kernel, x, low, mask, variance, t, bias, slope, jitter)
        )(theta)
        weights = jax.vmap(lambda f: cho_solve((f, True), y))(factors)
        return theta, factors, weights

    return jax.vmap(one)(low, mask, y, variance, bias, slope, mean, sd)


def _sample(score, first: Array, second: Array, kept: int) -> Array:
    """`kept` points z (kept, p) of equal weight from prior N(0, 1) × exp(score)."""
    p = first.shape[1]
    like1 = jax.vmap(score)(first)
    w = jax.nn.softmax(like1)
    centre = w @ first
    apart = first - centre[None, :]
    # With few effective samples their spread says little; the prior's own variance is mixed in.
    effective = 1 / jnp.sum(w**2)
    share = 1 / (1 + effective / p)
    spread = (apart * w[:, None]).T @ apart * (1 - share) + 0.25 * share * jnp.eye(p)
    root = jnp.linalg.cholesky(INFLATION**2 * spread + 1e-6 * jnp.eye(p))
    moved = centre[None, :] + second @ root.T
    like = jnp.concatenate([like1, jax.vmap(score)(moved)])
    points = jnp.concatenate([first, moved])
    white = solve_triangular(root, (points - centre[None, :]).T, lower=True).T
    proposal = _log_normal(white) - jnp.sum(jnp.log(jnp.diagonal(root)))
    prior = _log_normal(points)
    log_weight = like + prior - jnp.logaddexp(prior, proposal)
    weight = jax.nn.softmax(log_weight)
    edges = jnp.cumsum(weight)
    picks = jnp.searchsorted(edges, (jnp.arange(kept) + 0.5) / kept * edges[-1])
    return points[jnp.clip(picks, 0, points.shape[0] - 1)]


@partial(jax.jit, static_argnums=(0,))
def _predict(
    kernel: str, x: Array, low: Array, mask: Array, theta: Array, factor: Array, weights: Array,
    bias: Array, slope: Array, xq: Array, lq: Array,
) -> tuple[Array, Array]:  # fmt: skip
    def sample(theta, factor, weights, low, mask, lq, bias, slope):
        cross = _covariance(kernel, x, low, xq, lq, theta, bias, slope) * mask[:, None]
        white = solve_triangular(factor, cross, lower=True)
        own = _own_variance(kernel, xq, lq, theta, bias, slope)
        return weights @ cross, jnp.maximum(own - jnp.sum(white**2, axis=0), 0.0)

    def one(theta, factor, weights, low, mask, lq, bias, slope):
        means, variances = jax.vmap(sample, in_axes=(0, 0, 0, None, None, None, None, None))(
            theta, factor, weights, low, mask, lq, bias, slope
        )
        mean = jnp.mean(means, axis=0)
        return mean, jnp.mean(variances, axis=0) + jnp.var(means, axis=0)

    return jax.vmap(one)(theta, factor, weights, low, mask, lq, bias, slope)


@partial(jax.jit, static_argnums=(0,))
def cross_covariance(
    kernel: str, x: Array, low: Array, mask: Array, theta: Array, factor: Array, bias: Array,
    slope: Array, xa: Array, la: Array, xb: Array, lb: Array,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Posterior covariance (k, a, b), variances (k, a) and (k, b) of one output, per sample."""

    def sample(theta, factor):
        def white(xq, lq):
            cross = _covariance(kernel, x, low, xq, lq, theta, bias, slope) * mask[:, None]
            return solve_triangular(factor, cross, lower=True)

        wa, wb = white(xa, la), white(xb, lb)
        prior = _covariance(kernel, xa, la, xb, lb, theta, bias, slope)
        va = _own_variance(kernel, xa, la, theta, bias, slope) - jnp.sum(wa**2, axis=0)
        vb = _own_variance(kernel, xb, lb, theta, bias, slope) - jnp.sum(wb**2, axis=0)
        return prior - wa.T @ wb, jnp.maximum(va, 0.0), jnp.maximum(vb, 0.0)

    return jax.vmap(sample)(theta, factor)
