"""Sparse variational GP of one output: thousands of points at the price of a few hundred.

The collapsed bound of Titsias (2009, eq. 9), in which the best q(u) is already put in: what is left
are the hyperparameters, and L-BFGS finds them in tens of steps. Points may have a weight, so that
an uncertain input can stand as several possible ones (the Ψ statistics of Damianou & Lawrence
2013, by quadrature). Inducing points are taken from the data where they explain most, one after
the other (Burt et al. 2020).
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.linalg import solve_triangular
from scipy.linalg import solve_triangular as solve_lower
from scipy.optimize import minimize

from planner import jax_setup
from planner.studies.models import laplace
from planner.studies.models.fidelity_levels import Samples, spread
from planner.studies.models.mixture import Mixture
from planner.surrogate.ar1 import OutputPrior
from planner.surrogate.kernels import parse
from planner.surrogate.predictive import Predictive

PRIOR = OutputPrior(bias_sd=1.0, slope_sd=0.0, amplitude=1.0, nugget=0.03, length_spread=1.5)
JITTER = 1e-7  # relative to the prior variance, of the inducing points' covariance
ROUNDS = (15, 60)  # steps of L-BFGS before and after the inducing points are chosen anew


@dataclass(frozen=True, eq=False)
class SparseGP:
    """Fitted, of y = centre + scale·(…); `log_evidence` is the bound, below the evidence."""

    kernel: str
    theta: np.ndarray
    inducing: np.ndarray  # (i, d)
    root: np.ndarray  # (i, i) Cholesky factor of the inducing points' covariance
    inner: np.ndarray  # (i, i) Cholesky factor of I + A Aᵀ
    projected: np.ndarray  # (i,)
    centre: float
    scale: float
    log_evidence: float

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q,) of the noise-free output at x (q, d)."""
        kernel = parse(self.kernel, x.shape[1])
        cross = kernel.covariance(np, self.theta, self.inducing, x) + PRIOR.bias_sd**2
        first = solve_lower(self.root, cross, lower=True)
        second = solve_lower(self.inner, first, lower=True)
        own = kernel.variance(np, self.theta, x) + PRIOR.bias_sd**2
        variance = own - np.sum(first**2, axis=0) + np.sum(second**2, axis=0)
        sd = np.sqrt(np.maximum(variance, 0.0))
        return self.centre + self.scale * (self.projected @ second), self.scale * sd

    def predictive(self, x: np.ndarray) -> Predictive:
        """The same, which is one Gaussian."""
        mean, sd = self.predict(x)
        return Predictive(np.ones(1), mean[None], sd[None])


def fit_sparse(
    samples: Samples, kernel: str = "rbf", inducing: int = 200, weights: np.ndarray | None = None,
    prior: OutputPrior = PRIOR,
) -> SparseGP:  # fmt: skip
    """Sparse GP of `samples`, x scaled to about [0, 1]; `weights` (n,) of the points, default 1."""
    x = samples.x
    w = np.ones(len(x)) if weights is None else weights
    centre, scale = float(np.mean(samples.y)), spread(samples.y)
    y, variance = (samples.y - centre) / scale, (samples.sd / scale) ** 2
    k = parse(kernel, x.shape[1])
    mean, sd = k.prior(
        prior.amplitude, prior.nugget, prior.length, prior.spread, prior.length_spread
    )
    z, value = np.zeros(k.size), -np.inf
    u = x[:1]
    for steps in ROUNDS:
        u = choose_inducing(kernel, mean + sd * z, x, inducing)
        z, value = _climb(kernel, z, (x, y, variance, w, u, mean, sd), steps)
    evidence = value + 0.5 * float(z @ z) - float(w.sum()) * np.log(scale)
    return _build(kernel, mean + sd * z, (x, y, variance, w, u), centre, scale, evidence)


def _build(
    kernel: str, theta: np.ndarray, data: tuple[np.ndarray, ...], centre: float, scale: float,
    evidence: float,
) -> SparseGP:  # fmt: skip
    root, inner, projected = (np.array(a) for a in _solve(kernel, theta, *data)[:3])
    return SparseGP(kernel, theta, data[-1], root, inner, projected, centre, scale, evidence)


def average_sparse(
    fitted: SparseGP, samples: Samples, weights: np.ndarray | None = None,
    prior: OutputPrior = PRIOR, count: int = laplace.COUNT,
) -> Mixture:  # fmt: skip
    """Laplace mixture over the hyperparameters of what `fit_sparse` made of the same samples."""
    x, kernel = samples.x, fitted.kernel
    w = np.ones(len(x)) if weights is None else weights
    y = (samples.y - fitted.centre) / fitted.scale
    data = (x, y, (samples.sd / fitted.scale) ** 2, w, fitted.inducing)
    mean, sd = parse(kernel, x.shape[1]).prior(
        prior.amplitude, prior.nugget, prior.length, prior.spread, prior.length_spread
    )
    peak = (fitted.theta - mean) / sd
    points, volume = laplace.draws(
        lambda z: -np.array(bound(kernel, z, *data, mean, sd)[1]), peak, count
    )
    evidence = fitted.log_evidence - 0.5 * float(peak @ peak) + volume
    parts = {
        str(i): _build(kernel, mean + sd * z, data, fitted.centre, fitted.scale, evidence)
        for i, z in enumerate(points)
    }
    return Mixture(parts, dict.fromkeys(parts, 1 / count), evidence)


def choose_inducing(kernel: str, theta: np.ndarray, x: np.ndarray, count: int) -> np.ndarray:
    """`count` rows of x at most, each where those before leave most variance unexplained."""
    k = parse(kernel, x.shape[1])
    left = k.variance(np, theta, x).astype(float)
    whole = float(left.max())
    rows: list[int] = []
    factor = np.zeros((min(count, len(x)), len(x)))
    for i in range(len(factor)):
        pick = int(np.argmax(left))
        if left[pick] < 1e-6 * whole:
            break
        column = k.covariance(np, theta, x[pick : pick + 1], x)[0]
        factor[i] = (column - factor[:i, pick] @ factor[:i]) / np.sqrt(left[pick])
        left = np.maximum(left - factor[i] ** 2, 0.0)
        rows.append(pick)
    return x[rows]


def _climb(
    kernel: str, z: np.ndarray, data: tuple[np.ndarray, ...], steps: int
) -> tuple[np.ndarray, float]:
    def negative(z: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = bound(kernel, z, *data)
        if not (np.isfinite(value) and np.isfinite(slope).all()):
            return 1e10, np.zeros(len(z))
        return -float(value), -np.array(slope)

    done = minimize(
        negative, z, jac=True, method="L-BFGS-B", bounds=[(-4.0, 4.0)] * len(z),
        options={"maxiter": steps},
    )  # fmt: skip
    return done.x, -float(done.fun)


@jax_setup.compiled(static_argnums=0)
def bound(
    kernel: str, z: Array, x: Array, y: Array, variance: Array, w: Array, u: Array, mean: Array,
    sd: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """Lower bound of the log evidence plus log prior of z, θ = mean + sd·z, and its slope."""

    def value(z: Array) -> Array:
        return _solve(kernel, mean + sd * z, x, y, variance, w, u)[3] - 0.5 * jnp.sum(z**2)

    return jax.value_and_grad(value)(z)


@jax_setup.compiled(static_argnums=0)
def _solve(
    kernel: str, theta: Array, x: Array, y: Array, variance: Array, w: Array, u: Array
) -> tuple[Array, Array, Array, Array]:
    k = parse(kernel, x.shape[1])
    bias = PRIOR.bias_sd**2
    own = k.variance(jnp, theta, x) + bias
    kuu = k.covariance(jnp, theta, u, u) + bias
    noise = variance + jnp.exp(2 * theta[1])
    root = jnp.linalg.cholesky(kuu + JITTER * jnp.max(own) * jnp.eye(u.shape[0]))
    each = jnp.sqrt(w / noise)
    a = solve_triangular(root, k.covariance(jnp, theta, u, x) + bias, lower=True) * each[None, :]
    inner = jnp.linalg.cholesky(jnp.eye(u.shape[0]) + a @ a.T)
    projected = solve_triangular(inner, a @ (y * each), lower=True)
    fit = jnp.sum(w * y**2 / noise) - jnp.sum(projected**2)
    size = jnp.sum(w * jnp.log(2 * jnp.pi * noise)) + 2 * jnp.sum(jnp.log(jnp.diagonal(inner)))
    lost = jnp.sum(w * own / noise) - jnp.sum(a**2)
    return root, inner, projected, -0.5 * (fit + size + lost)
