"""Gaussian processes of many outputs, averaged over hyperparameters, in one compiled function.

Per output: y = mean + ρ'·h + b + δ(x) + ε, where h is the centred low fidelity, ρ' = ρ − 1 and b
have Gaussian priors that are marginalised exactly as kernel terms, δ is a zero-mean GP, and ε has
the measurement's own variance plus a nugget τ². The hyperparameters θ (see `kernels.Kernel`) are
averaged: samples from the prior, then from a Gaussian around what the data favour, weighted
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

from planner.errors import InputError
from planner.fusion import jaxsetup
from planner.fusion.data import Padded
from planner.fusion.kernels import Kernel, parse
from planner.fusion.predictive import Predictive

INFLATION = 1.4  # of the second stage's spread, so that tails are sampled too
JITTERS = (1e-13, 1e-10, 1e-8, 1e-6)  # relative to the prior variance
UNREMARKABLE = 1e-10
SINGULAR = (
    "The covariance was singular until {:g} of its variance was added to the noise: two poses are "
    "nearly the same, and their sds claim more than that."
)


@dataclass(frozen=True, eq=False)
class Prior:
    """Prior of m outputs: mean (m,), sd of b and ρ' (m,), θ's mean and sd (m, p)."""

    mean: np.ndarray
    bias_sd: np.ndarray
    slope_sd: np.ndarray
    theta_mean: np.ndarray
    theta_sd: np.ndarray


@dataclass(frozen=True, eq=False)
class Posterior:
    """m outputs, k hyperparameter samples of equal weight, c padded training points.

    Everything after the fit is plain NumPy on few, small matrices.
    """

    x: np.ndarray  # (c, d)
    low: np.ndarray  # (m, c) centred
    mask: np.ndarray  # (m, c)
    theta: np.ndarray  # (m, k, p)
    whiten: np.ndarray  # (m, k, c, c) inverse of the Cholesky factor
    weights: np.ndarray  # (m, k, c) K⁻¹(y − mean)
    prior: Prior
    kernel: str
    log_evidence: np.ndarray  # (m,) log p(y | model), θ averaged out
    remarks: tuple[str, ...] = ()

    def predict(
        self, x: np.ndarray, low: np.ndarray, outputs: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, m) of the outputs, noise-free, at x (q, d) with centred low (q, m).

        `outputs` (indices) asks for some of them only.
        """
        asked = range(len(self.mask)) if outputs is None else outputs.tolist()
        mean, sd = np.empty((len(x), len(asked))), np.empty((len(x), len(asked)))
        for i, j in enumerate(asked):
            found = self.predictive(j, x, low[:, j])
            mean[:, i], sd[:, i] = found.mean, found.sd
        return mean, sd

    def predictive(self, j: int, x: np.ndarray, low: np.ndarray) -> Predictive:
        """Output j, noise-free, at x (q, d) with centred low (q,), one Gaussian per sample."""
        cross, white = self._cross(j, x, low)
        means = self.prior.mean[j] + (self.weights[j][:, None, :] @ cross)[:, 0]
        own = self._own(j, x, low) - np.sum(white**2, axis=1)
        return Predictive(np.full(len(means), 1 / len(means)), means, np.sqrt(np.maximum(own, 0.0)))

    def covariance(
        self, j: int, xa: np.ndarray, la: np.ndarray, xb: np.ndarray, lb: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Posterior covariance (k, a, b), variances (k, a), (k, b) of output j, per sample."""
        _, wa = self._cross(j, xa, la)
        _, wb = self._cross(j, xb, lb)
        prior = self._prior(j, xa, la, xb, lb)
        va = self._own(j, xa, la) - np.sum(wa**2, axis=1)
        vb = self._own(j, xb, lb) - np.sum(wb**2, axis=1)
        covariance = prior - np.swapaxes(wa, 1, 2) @ wb
        return covariance, np.maximum(va, 0.0), np.maximum(vb, 0.0)

    def nugget_variance(self) -> np.ndarray:
        """Mean nugget variance (m,)."""
        return np.mean(np.exp(2 * self.theta[:, :, 1]), axis=1)

    def slopes(self, j: int) -> np.ndarray:
        """Posterior mean (k,) of ρ' of output j, per sample."""
        return self.prior.slope_sd[j] ** 2 * (self.weights[j] @ (self.low[j] * self.mask[j]))

    def _prior(
        self, j: int, xa: np.ndarray, la: np.ndarray, xb: np.ndarray, lb: np.ndarray
    ) -> np.ndarray:
        prior = self.prior
        linear = prior.bias_sd[j] ** 2 + prior.slope_sd[j] ** 2 * np.outer(la, lb)
        return self._delta.covariance(np, self.theta[j], xa, xb) + linear

    @property
    def _delta(self) -> Kernel:
        return parse(self.kernel, self.x.shape[1])

    def _own(self, j: int, x: np.ndarray, low: np.ndarray) -> np.ndarray:
        """Prior variances (k, q)."""
        prior = self.prior
        linear = prior.bias_sd[j] ** 2 + prior.slope_sd[j] ** 2 * low**2
        return self._delta.variance(np, self.theta[j], x) + linear

    def _cross(self, j: int, x: np.ndarray, low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Prior covariance (k, n, q) with the training points, and L⁻¹ times it.

        Padding is left out here: n counts the points that hold a value.
        """
        known = np.flatnonzero(self.mask[j])
        cross = self._prior(j, self.x[known], self.low[j][known], x, low)
        full = np.zeros((len(cross), self.mask.shape[1], len(x)))
        full[:, known] = cross
        return full, self.whiten[j][:, known[:, None], known[None, :]] @ cross


def fit(
    padded: Padded, prior: Prior, samples: int = 256, kept: int = 32, kernel: str = "matern52",
    rounds: int = 1, start: tuple[np.ndarray, np.ndarray] | None = None,
) -> Posterior:  # fmt: skip
    """Posterior of all outputs; y and low of `padded` as they are, prior mean taken off here.

    `samples` of θ from the prior and as many in each of `rounds`; `start`, centre (m, p) and root
    (m, p, p) in units of the prior, is where the first round looks, as `marginal.laplace` finds.

    InputError if the covariance stays singular whatever is added to its diagonal.
    """
    p = prior.theta_mean.shape[1]
    first, *more = normal_points(samples, p, 1 + rounds)
    moved = np.stack(more)
    y = (padded.y - prior.mean[:, None]) * padded.mask

    def attempt(jitter: float) -> tuple[Array, Array, Array, Array]:
        return _fit(
            kernel, kept, padded.x, padded.low, padded.mask, y, padded.variance,
            prior.bias_sd, prior.slope_sd, prior.theta_mean, prior.theta_sd, first, moved, jitter,
            start,
        )  # fmt: skip

    for jitter in JITTERS:
        theta, whiten, weights, evidence = (np.array(a) for a in attempt(jitter))
        if np.isfinite(weights).all() and np.isfinite(whiten).all():
            remarks = (SINGULAR.format(jitter),) if jitter > UNREMARKABLE else ()
            evidence = evidence - 0.5 * np.log(2 * np.pi) * np.sum(padded.mask, axis=1)
            return Posterior(
                padded.x, padded.low, padded.mask, theta, whiten, weights, prior, kernel,
                evidence, remarks,
            )  # fmt: skip
    raise InputError(
        "No Gaussian process fits the measured modes; set aside poses that are measured twice "
        "or far off with `planner withdraw`."
    )


def normal_points(samples: int, p: int, count: int) -> list[np.ndarray]:
    """`count` sets (samples, p) of quasi-random standard normal points, the same every time."""
    sets = []
    for seed in range(1, count + 1):
        sobol = qmc.Sobol(p, scramble=True, rng=np.random.default_rng(seed))
        unit = sobol.random_base2(int(np.ceil(np.log2(samples))))[:samples]
        sets.append(norm.ppf(np.clip(unit, 1e-6, 1 - 1e-6)))
    return sets


def _covariance(
    kernel: str, xa: Array, la: Array, xb: Array, lb: Array, theta: Array, bias: Array, slope: Array
) -> Array:
    """Prior covariance (a, b) of one output at one θ."""
    delta = parse(kernel, xa.shape[1]).covariance(jnp, theta, xa, xb)
    return delta + bias**2 + slope**2 * la[:, None] * lb[None, :]


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


@partial(jaxsetup.quickly_compiled, static_argnums=(0, 1))
def _fit(
    kernel: str, kept: int, x: Array, low: Array, mask: Array, y: Array, variance: Array,
    bias: Array, slope: Array, mean: Array, sd: Array, first: Array, rounds: Array, jitter: Array,
    start: tuple[Array, Array] | None,
) -> tuple[Array, Array, Array, Array]:  # fmt: skip
    def one(low, mask, y, variance, bias, slope, mean, sd, start):
        score = partial(_log_likelihood, kernel, x, low, mask, y, variance, bias, slope, jitter)
        z, evidence = _sample(lambda z: score(mean + sd * z), first, rounds, kept, start)
        theta = mean[None, :] + sd[None, :] * z
        factors = jax.vmap(
            lambda t: _factor(kernel, x, low, mask, variance, t, bias, slope, jitter)
        )(theta)
        one = jnp.eye(y.shape[0])
        whiten = jax.vmap(lambda f: solve_triangular(f, one, lower=True))(factors)
        weights = jax.vmap(lambda f: cho_solve((f, True), y))(factors)
        return theta, whiten, weights, evidence

    return jax.vmap(one)(low, mask, y, variance, bias, slope, mean, sd, start)


def _sample(score, first: Array, rounds: Array, kept: int, start) -> tuple[Array, Array]:
    """`kept` points z (kept, p) of equal weight from N(0, 1) × exp(score); log of its integral.

    Points from the prior, then `rounds` (t, s, p) of them from Gaussians around what weighs most
    so far; the first of these is `start`, centre (p,) and root (p, p), if there is one.
    """
    points, like = first, jax.vmap(score)(first)
    mixture = _log_normal(points)[:, None]  # log-density of every point under every proposal
    proposals = []
    for t, normal in enumerate(rounds):
        if t == 0 and start is not None:
            centre, root = start
        else:
            weight = jax.nn.softmax(like + _log_normal(points) - _log_mean(mixture))
            centre, root = _around(points, weight)
        proposals.append((centre, INFLATION * root))
        moved = centre[None, :] + INFLATION * normal @ root.T
        points = jnp.concatenate([points, moved])
        like = jnp.concatenate([like, jax.vmap(score)(moved)])
        densities = [_log_normal(points), *(_log_gaussian(points, *g) for g in proposals)]
        mixture = jnp.stack(densities, axis=1)
    log_weight = like + _log_normal(points) - _log_mean(mixture)
    evidence = jax.nn.logsumexp(log_weight) - jnp.log(1.0 * points.shape[0])
    weight = jax.nn.softmax(log_weight)
    # Every 16th point of a Sobol sequence is not spread evenly; in the order of the steepness of
    # δ, on which predictions away from the data hang, every 16th is.
    order = jnp.argsort(points[:, 0] - jnp.sum(points[:, 2:], axis=1) / max(points.shape[1] - 2, 1))
    points, weight = points[order], weight[order]
    edges = jnp.cumsum(weight)
    picks = jnp.searchsorted(edges, (jnp.arange(kept) + 0.5) / kept * edges[-1])
    return points[jnp.clip(picks, 0, points.shape[0] - 1)], evidence


def _around(points: Array, weight: Array) -> tuple[Array, Array]:
    """Centre (p,) and root (p, p) of a Gaussian like the weighted points."""
    p = points.shape[1]
    centre = weight @ points
    apart = points - centre[None, :]
    # With few effective samples their spread says little; the prior's own variance is mixed in.
    effective = 1 / jnp.sum(weight**2)
    share = 1 / (1 + effective / p)
    spread = (apart * weight[:, None]).T @ apart * (1 - share) + 0.25 * share * jnp.eye(p)
    return centre, jnp.linalg.cholesky(spread + 1e-6 * jnp.eye(p))


def _log_gaussian(points: Array, centre: Array, root: Array) -> Array:
    white = solve_triangular(root, (points - centre[None, :]).T, lower=True).T
    return _log_normal(white) - jnp.sum(jnp.log(jnp.diagonal(root)))


def _log_mean(logs: Array) -> Array:
    return jax.nn.logsumexp(logs, axis=1) - jnp.log(1.0 * logs.shape[1])
