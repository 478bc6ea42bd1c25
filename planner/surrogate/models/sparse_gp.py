"""Sparse variational GP of one output: thousands of points at the price of a few hundred.

The collapsed bound of Titsias (2009, eq. 9), in which the best q(u) is already put in: what is left
are the hyperparameters, and L-BFGS finds them in tens of steps. Points may have a weight, so that
an uncertain input can stand as several possible ones (the Ψ statistics of Damianou & Lawrence
2013, by quadrature). Inducing points are taken from the data where they explain most, one after
the other (Burt et al. 2020).
"""

from dataclasses import dataclass
from typing import Any, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.linalg import solve_triangular
from scipy.linalg import solve_triangular as solve_lower

from planner import jax_setup
from planner.inference.quasi_newton import Peak, maximise
from planner.surrogate.ar1 import OutputPrior
from planner.surrogate.kernels import parse
from planner.surrogate.models.fidelity_levels import Samples, spread

PRIOR = OutputPrior(bias_sd=1.0, slope_sd=0.0, amplitude=1.0, nugget=0.03, length_spread=1.5)
REACH = 4.0  # sds of the prior beyond which nothing is looked for
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


def fit_sparse(
    samples: Samples, kernel: str = "rbf", inducing: int = 200, weights: np.ndarray | None = None
) -> SparseGP:
    """Sparse GP of `samples`, x scaled to about [0, 1]; `weights` (n,) of the points, default 1."""
    x = samples.x
    w = np.ones(len(x)) if weights is None else weights
    centre, scale = float(np.mean(samples.y)), spread(samples.y)
    y, variance = (samples.y - centre) / scale, (samples.sd / scale) ** 2
    mean, sd = PRIOR.of_theta(parse(kernel, x.shape[1]))
    peak, u = Peak(np.zeros(len(mean)), -np.inf), x[:1]
    for steps in ROUNDS:
        u = choose_inducing(parse(kernel, x.shape[1]), mean + sd * peak.x, x, inducing)
        data = x, y, variance, w, u, mean, sd
        peak = maximise(
            lambda z, data=data: bound(kernel, z, *data), [peak.x], -REACH, REACH, steps
        )
    z = peak.x
    evidence = peak.log_density + 0.5 * float(z @ z) - float(w.sum()) * np.log(scale)
    theta = mean + sd * z
    root, inner, projected = (np.array(a) for a in _solve(kernel, theta, x, y, variance, w, u)[:3])
    return SparseGP(kernel, theta, u, root, inner, projected, centre, scale, evidence)


class Covarying(Protocol):
    """What kernels are asked for here; see `planner.surrogate.kernels.Kernel`."""

    def covariance(self, xp: Any, theta: Any, xa: Any, xb: Any) -> Any:
        """(a, b) of xa (a, d), xb (b, d)."""
        ...

    def variance(self, xp: Any, theta: Any, x: Any) -> Any:
        """Its diagonal (a,)."""
        ...


def choose_inducing(k: Covarying, theta: np.ndarray, x: np.ndarray, count: int) -> np.ndarray:
    """`count` rows of x at most, each where those before leave most variance unexplained."""
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
