"""GP of one output as it is usually published: hyperparameters of the greatest likelihood.

y ~ N(0, K + τ² I); log p(y | θ) = −½ yᵀ(K + τ²I)⁻¹y − ½ log|K + τ²I| − (n/2) log 2π (Rasmussen &
Williams 2006, eq. 5.8) is climbed from several starts, the best taken; no prior, no averaging.
Predictions are eqs. 2.23 and 2.24 there. With few points this is over-confident (`single_output_gp`
averages instead): it is here because the papers do so.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.linalg import cho_solve, solve_triangular

from planner import jax_setup
from planner.inference.quasi_newton import Peak, maximise
from planner.studies.models.fidelity_levels import Samples, spread
from planner.surrogate.kernels import parse
from planner.surrogate.training_data import capacity

# Of log θ: amplitudes and length scales from 1e-3 to 1e5 in units of y's and x's own scale.
LOWEST, HIGHEST = float(np.log(1e-3)), float(np.log(1e5))
LENGTH = 0.4  # length scales from which a climb begins, times √d; x is scaled to about [0, 1]
LEAST_NOISE = 1e-4  # sd over y's scale, where the noise is fitted
JITTER = 1e-8  # variance over y's scale squared, as GPy adds it
# Noise that is known and small leaves K + τ²I so ill-conditioned far from the peak that a first
# step ends where every point stands alone: most climbs begin with more noise, then with less.
# Too much of it at first leads them all to one peak: so each start begins one level further on.
NOISES = (0.5, 0.1, 0.01)
MOST_STEPS, FEW_STEPS = 200, 30  # of a climb; of one that begins near the peak
STARTS = 5  # "five optimization runs" (Busch et al. 2022, section 2.3.1)


@dataclass(frozen=True, eq=False)
class Normalisation:
    """y is modelled as (y − centre) / scale."""

    centre: float
    scale: float

    @classmethod
    def of(cls, y: np.ndarray) -> "Normalisation":
        """Mean and sd of y."""
        return cls(float(np.mean(y)), spread(y))


@dataclass(frozen=True, eq=False)
class LikelihoodGP:
    """Fitted at x (n, d); `theta` as `planner.surrogate.kernels` lays it out, log τ included."""

    kernel: str
    theta: np.ndarray
    x: np.ndarray
    root: np.ndarray  # (n, n) Cholesky factor of K + τ²I
    alpha: np.ndarray  # (n,)
    units: Normalisation
    log_likelihood: float  # of y in its own unit

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q,) of the noise-free output at x (q, d)."""
        kernel = parse(self.kernel, x.shape[1])
        cross = kernel.covariance(np, self.theta, self.x, x)
        explained = np.sum(solve_triangular(self.root, cross, lower=True) ** 2, axis=0)
        sd = np.sqrt(np.maximum(kernel.variance(np, self.theta, x) - explained, 0.0))
        units = self.units
        return units.centre + units.scale * (self.alpha @ cross), units.scale * sd


def fit_likelihood(
    samples: Samples,
    kernel: str = "rbf",
    noise: float | None = None,
    units: Normalisation | None = None,
    starts: int = STARTS,
    seed: int = 0,
    begin: np.ndarray | None = None,
) -> LikelihoodGP:
    """Maximum-likelihood GP of `samples`.

    Args:
        samples: x (n, d) scaled to about [0, 1] and y (n,); sds are not looked at.
        kernel: an expression over the columns of x.
        noise: τ over y's scale, where it is known; None: it is fitted.
        units: by what y is normalised; None: its own mean and sd.
        starts: how many; the first is in the middle, the others random around it.
        seed: of the random starts.
        begin: log θ (p,) near the peak, such as that of fewer points: the only start then.
    """
    x = samples.x
    units = units or Normalisation.of(samples.y)
    y = (samples.y - units.centre) / units.scale
    middle, _ = parse(kernel, x.shape[1]).prior(1.0, NOISES[0], LENGTH, 0.0, 0.0)
    size = len(middle)
    lower, upper = np.full(size, LOWEST), np.full(size, HIGHEST)
    lower[1] = np.log(LEAST_NOISE if noise is None else noise)
    upper[1] = 0.0 if noise is None else lower[1]
    rng = np.random.default_rng(seed)
    near = middle + np.vstack([np.zeros(size), rng.standard_normal((starts - 1, size))])
    padded = _padded(x, y)

    def climb(theta: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> Peak:
        start = [np.clip(theta, lower, upper)]
        steps = MOST_STEPS if begin is None else FEW_STEPS
        return maximise(lambda z: _log_likelihood(kernel, z, *padded), start, lower, upper, steps)

    ends = []
    levels = NOISES[:1] if noise is None else [level for level in NOISES if level > noise]
    for i, theta in enumerate(near if begin is None else [begin]):
        for held in levels[i % (len(levels) + 1) :] if begin is None else ():
            at = np.where(np.arange(size) == 1, np.log(held), 0.0)
            free = np.arange(size) != 1
            theta = climb(theta, np.where(free, lower, at), np.where(free, upper, at)).x
        ends.append(climb(theta, lower, upper))
    best = max(ends, key=lambda peak: peak.log_density)
    return at_hyperparameters(samples, kernel, best.x, units)


def at_hyperparameters(
    samples: Samples, kernel: str, theta: np.ndarray, units: Normalisation
) -> LikelihoodGP:
    """The GP of `samples` with given hyperparameters (p,), log τ in their second place."""
    y = (samples.y - units.centre) / units.scale
    root = np.linalg.cholesky(_covariance(kernel, theta, samples.x))
    white = solve_triangular(root, y, lower=True)
    size = np.sum(np.log(np.diag(root))) + len(y) * (0.5 * np.log(2 * np.pi) + np.log(units.scale))
    value = float(-0.5 * white @ white - size)
    return LikelihoodGP(kernel, theta, samples.x, root, cho_solve((root, True), y), units, value)


def _covariance(kernel: str, theta: np.ndarray, x: np.ndarray) -> np.ndarray:
    k = parse(kernel, x.shape[1]).covariance(np, theta, x, x)
    noise = np.exp(2 * theta[1]) + JITTER
    return k + noise * np.eye(len(x))


def _padded(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x (c, d), y (c,) and which of them count (c,), so that few sizes are compiled."""
    more = capacity(len(x)) - len(x)
    mask = np.concatenate([np.ones(len(x)), np.zeros(more)])
    return np.pad(x, ((0, more), (0, 0))), np.pad(y, (0, more)), mask


@jax_setup.compiled(static_argnums=0)
def _log_likelihood(
    kernel: str, theta: Array, x: Array, y: Array, mask: Array
) -> tuple[Array, Array]:
    """log p(y | θ) and its slope; entries without mask have covariance I and value 0."""

    def value(theta: Array) -> Array:
        k = parse(kernel, x.shape[1]).covariance(jnp, theta, x, x) * mask[:, None] * mask[None, :]
        noise = jnp.exp(2 * theta[1]) + JITTER
        root = jnp.linalg.cholesky(k + jnp.diag(jnp.where(mask > 0, noise, 1.0)))
        white = jax.scipy.linalg.solve_triangular(root, y, lower=True)
        size = jnp.sum(jnp.log(jnp.diagonal(root))) + 0.5 * jnp.sum(mask) * jnp.log(2 * jnp.pi)
        return -0.5 * jnp.sum(white**2) - size

    return jax.value_and_grad(value)(theta)
