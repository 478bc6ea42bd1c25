"""MFDGP as published (Cutajar et al. 2019): a deep GP over fidelities, all layers trained together.

Layer 1, f_1 ~ GP(0, k_1(x)), explains the cheap samples; layer 2 is a GP of (x, f_1(x)) with the
kernel k_ρ(x) (σ² f f' + k_f(f, f')) + k_δ(x) and explains the expensive ones. Each
has inducing values u_l with a normal q(u_l) of its own. What is climbed is the doubly stochastic
bound (Salimbeni & Deisenroth 2017)

    Σ_t Σ_i E[log p(y_i^t | f_t(x_i))] − Σ_l KL(q(u_l) ‖ p(u_l)),

where f_1 is drawn from its marginal, f = μ + σ ε, on the way to layer 2, for a batch of the points:
both layers, all q(u_l), kernels and noises move together, by Adam (Kingma & Ba 2015). As in Busch
et al. 2020 (Table 1) noises and the q(u_l)'s covariances are held in a first stage. Here q(u_l) is
written for L⁻¹u (the same model in other coordinates), inducing inputs are data and stay, and a
prediction integrates over f_1(x) by quadrature, where the paper draws samples of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.example_libraries.optimizers import adam
from jax.scipy.linalg import solve_triangular

from planner import jax_setup
from planner.surrogate.ar1 import AR1
from planner.surrogate.frequency_models import FEWEST, FrequencyData
from planner.surrogate.kernels import Kernel, parse
from planner.surrogate.models.likelihood_gp import NODES, WEIGHTS, Normalisation, Samples

JITTER = 1e-6  # of the inducing points' covariance, relative to the prior variance
LENGTH = 0.15  # of x at the start, times √d; x is scaled to about [0, 1]
START_OWN = 0.3  # amplitude of k_δ at the start, over the output's sd
START_NOISE = 0.1  # sd over the output's, held in the first stage
START_SPREAD = 0.1  # of q(L⁻¹u) at the start, held in the first stage
MOST_TO_BEGIN = 1500  # points from which q(u) begins


@dataclass(frozen=True, eq=False)
class TiedKernel(Kernel):
    """A kernel of fewer θ, some of which stand in its own several times, as `rows` say."""

    rows: np.ndarray

    @classmethod
    def cutajar(cls, d: int) -> "TiedKernel":
        """k_ρ(x) (σ² f f' + k_f(f, f')) + k_δ(x) over the columns (x_1 … x_d, f).

        θ = (log σ_ρ, log τ, d scales of k_ρ, log σ, scale of k_f, log σ_δ, d scales of k_δ).
        """
        below, one = f"[{d}:{d + 1}]", np.eye(2 * d + 5)
        text = f"rbf[:{d}]*linear{below}+rbf[:{d}]*rbf{below}+rbf[:{d}]"
        shared = one[2 : d + 2]
        rows = [one[0] + one[d + 2], one[1], *shared, 0 * one[0], one[0], *shared, *one[d + 3 :]]
        return cls(**vars(parse(text, d + 1)), rows=np.array(rows))

    def covariance(self, xp: Any, theta: Any, xa: Any, xb: Any) -> Any:
        """See `Kernel.covariance`."""
        return super().covariance(xp, theta @ self.rows.T, xa, xb)


class Layer(NamedTuple):
    """θ (p,) of the kernel, the noise's log sd in θ's second place; q(L⁻¹u) = N(m, R Rᵀ)."""

    theta: Any
    mean: Any  # (i,)
    root: Any  # (i, i), of which the lower triangle counts


@dataclass(frozen=True)
class Training:
    """Steps and rates of both stages, points in a batch, samples of f_1, inducing points.

    Busch et al. 2020 take 20,000 and 15,000 steps of 50 points with 800 inducing ones.
    """

    held_steps: int = 2000
    free_steps: int = 4000
    held_rate: float = 0.01
    free_rate: float = 0.005
    batch: int = 50
    draws: int = 2
    inducing: int = 100


# As a campaign chooses it: few measured poses, and a simulation without noise.
CHOSEN = Training(held_steps=500, free_steps=1500, inducing=60)


class TwoLevelData(NamedTuple):
    """Both levels' points and values, normalised; inducing inputs of both layers."""

    x_low: Any
    y_low: Any
    x_high: Any
    y_high: Any
    z_low: Any
    z_high: Any


@dataclass(frozen=True, eq=False)
class MFDGP:
    """Trained layers; values are in units of the levels' own means and sds."""

    layers: tuple[Layer, Layer]
    data: TwoLevelData
    high_units: Normalisation

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q,) of the noise-free expensive output at x (q, d)."""
        mean, variance = _predicted(self.layers, self.data, np.asarray(x, dtype=float))
        return self.high_units.restored(mean, np.sqrt(variance))


def fit_mfdgp(cheap: Samples, measured: Samples, how: Training) -> MFDGP:
    """Train both layers on cheap and measured samples, x (n, d) scaled to about [0, 1]."""
    low_units, high_units = Normalisation.of(cheap.y), Normalisation.of(measured.y)
    y_low, y_high = low_units.normalised(cheap.y), high_units.normalised(measured.y)
    d = measured.x.shape[1]
    # The cheap value nearest to a measured point begins as its f_1.
    near = np.argmin(np.sum((measured.x[:, None] - cheap.x[None]) ** 2, axis=-1), axis=1)
    wide = np.column_stack([measured.x, y_low[near]])
    one, two = parse("rbf", d), TiedKernel.cutajar(d)
    first = one.prior(1.0, START_NOISE, LENGTH, 0.0, 0.0)[0]
    starts = first, np.array([*first, 0.0, 0.0, np.log(START_OWN), *first[2:]])
    z_low = choose_inducing(one, starts[0], cheap.x, how.inducing)
    z_high = choose_inducing(two, starts[1], wide, how.inducing)
    data = TwoLevelData(cheap.x, y_low, measured.x, y_high, z_low, z_high)
    layers = (
        _at_the_data(one, starts[0], z_low, cheap.x, y_low),
        _at_the_data(two, starts[1], z_high, wide, y_high),
    )
    stages = (how.held_steps, how.held_rate, 0.0), (how.free_steps, how.free_rate, 1.0)
    for i, (steps, rate, free) in enumerate(stages):
        layers = _climbed(layers, data, i, rate, free, steps, how.batch, how.draws)
    return MFDGP(layers, data, high_units)


def choose_inducing(k: Kernel, theta: np.ndarray, x: np.ndarray, count: int) -> np.ndarray:
    """`count` rows of x at most, each where those before leave most variance unexplained.

    See Burt et al. 2020.
    """
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


def _at_the_data(
    k: Kernel, theta: np.ndarray, z: np.ndarray, x: np.ndarray, y: np.ndarray
) -> Layer:
    """A layer whose q(u) begins where the data are: m = L⁻¹ K_zx (K_xx + τ²I)⁻¹ y.

    Of many data some are enough for that.
    """
    some = np.linspace(0, len(x) - 1, min(len(x), MOST_TO_BEGIN)).astype(int)
    x, y = x[some], y[some]
    inducing = k.covariance(np, theta, z, z)
    root = np.linalg.cholesky(inducing + JITTER * np.mean(np.diag(inducing)) * np.eye(len(z)))
    own = k.covariance(np, theta, x, x) + np.exp(2 * theta[1]) * np.eye(len(x))
    smooth = k.covariance(np, theta, z, x) @ np.linalg.solve(own, y)
    return Layer(theta, np.linalg.solve(root, smooth), START_SPREAD * np.eye(len(z)))


def _marginal(kernel: Kernel, layer: Layer, z: Array, x: Array) -> tuple[Array, Array]:
    """Mean and variance (q,) of f at x (q, d) under q(u)."""
    own = kernel.variance(jnp, layer.theta, x)
    covariance = kernel.covariance(jnp, layer.theta, z, z)
    scale = jnp.mean(jnp.diagonal(covariance))
    root = jnp.linalg.cholesky(covariance + JITTER * scale * jnp.eye(len(z)))
    a = solve_triangular(root, kernel.covariance(jnp, layer.theta, z, x), lower=True)
    spread = jnp.tril(layer.root).T @ a
    variance = own - jnp.sum(a**2, axis=0) + jnp.sum(spread**2, axis=0)
    return layer.mean @ a, jnp.maximum(variance, 1e-12)


def _expected(layer: Layer, y: Array, mean: Array, variance: Array) -> Array:
    """E[log N(y | f, τ²)] (q,) over f ~ N(mean, variance)."""
    log_noise = layer.theta[1]
    return (
        -0.5 * jnp.log(2 * jnp.pi) - log_noise
        - 0.5 * ((y - mean) ** 2 + variance) * jnp.exp(-2 * log_noise)
    )  # fmt: skip


def _divergence(layer: Layer) -> Array:
    """KL(q(u) ‖ p(u)), in the coordinates L⁻¹u where p is the standard normal."""
    root = jnp.tril(layer.root)
    size = jnp.sum(jnp.log(jnp.abs(jnp.diagonal(root))))
    return 0.5 * (jnp.sum(root**2) + jnp.sum(layer.mean**2) - len(layer.mean)) - size


def bound(
    layers: tuple[Layer, Layer], data: TwoLevelData, low: Array, high: Array, noise: Array
) -> Array:
    """The bound from a batch `low` (b,) and `high` (b',) of points and ε (s, b')."""
    first, second = layers
    d = data.x_low.shape[1]
    one, two = parse("rbf", d), TiedKernel.cutajar(d)
    mean, variance = _marginal(one, first, data.z_low, data.x_low[low])
    total = jnp.mean(_expected(first, data.y_low[low], mean, variance)) * len(data.y_low)
    x = data.x_high[high]
    below, unsure = _marginal(one, first, data.z_low, x)
    drawn = below[None, :] + jnp.sqrt(unsure)[None, :] * noise
    wide = jnp.column_stack([jnp.tile(x, (len(noise), 1)), drawn.reshape(-1)])
    mean, variance = _marginal(two, second, data.z_high, wide)
    y = jnp.tile(data.y_high[high], len(noise))
    total += jnp.mean(_expected(second, y, mean, variance)) * len(data.y_high)
    return total - _divergence(first) - _divergence(second)


@jax_setup.compiled("quick", static_argnums=(6, 7))
def _climbed(
    layers: tuple[Layer, Layer], data: TwoLevelData, seed: int, rate: float, free: float,
    steps: int, batch: int, draws: int,
) -> tuple[Layer, Layer]:  # fmt: skip
    """So many steps of Adam; with `free` 0 noises and the spread of q stay, with 1 all moves."""
    n_low, n_high, key = len(data.y_low), len(data.y_high), jax.random.key(seed)
    moving = tuple(  # in the first stage neither the noise nor the spread of q
        Layer(
            jnp.where(jnp.arange(len(layer.theta)) == 1, free, 1.0),
            jnp.ones_like(layer.mean),
            free * jnp.ones_like(layer.root),
        )
        for layer in layers
    )

    def negative(now: tuple[Layer, Layer], key: Array) -> Array:
        one, two, three = jax.random.split(key, 3)
        low = jax.random.randint(one, (min(batch, n_low),), 0, n_low)
        high = jax.random.randint(two, (min(batch, n_high),), 0, n_high)
        noise = jax.random.normal(three, (draws, min(batch, n_high)))
        return -bound(now, data, low, high, noise)

    begun, updated, layers_of = adam(rate)

    def step(i: Any, state: Any) -> Any:
        slope = jax.grad(negative)(layers_of(state), jax.random.fold_in(key, i))
        return updated(i, jax.tree.map(jnp.multiply, slope, moving), state)

    return layers_of(jax.lax.fori_loop(0, steps, step, begun(layers)))


@jax_setup.compiled()
def _predicted(layers: tuple[Layer, Layer], data: TwoLevelData, x: Array) -> tuple[Array, Array]:
    """Mean and variance (q,) of f_2, integrated over f_1(x)."""
    d = data.x_low.shape[1]
    below, unsure = _marginal(parse("rbf", d), layers[0], data.z_low, x)
    nodes = below[None, :] + jnp.sqrt(unsure)[None, :] * NODES[:, None]
    wide = jnp.column_stack([jnp.tile(x, (len(NODES), 1)), nodes.reshape(-1)])
    parts = _marginal(TiedKernel.cutajar(d), layers[1], data.z_high, wide)
    mean, variance = (part.reshape(len(NODES), -1) for part in parts)
    middle = WEIGHTS @ mean
    return middle, WEIGHTS @ (variance + (mean - middle[None, :]) ** 2)


@dataclass(frozen=True, eq=False)
class DeepOutputs:
    """A deep GP of each output."""

    each: Sequence[MFDGP]

    def predict(self, x: np.ndarray, low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, m) at x (q, d)."""
        found = [one.predict(x) for one in self.each]
        return np.stack([m for m, _ in found], axis=1), np.stack([s for _, s in found], axis=1)


def fit_deep(seen: FrequencyData, ar1: AR1) -> DeepOutputs | None:
    """None where an output has too few values, or the simulation none of it."""
    if seen.elsewhere is None:
        return None
    data, (x, low) = seen.values, seen.elsewhere
    cheap = [Samples.of(x, column) for column in low.T]
    measured = [Samples.of(data.x, y, sd) for y, sd in zip(data.y.T, data.sd.T, strict=True)]
    if min(len(s.y) for s in (*cheap, *measured)) < FEWEST:
        return None
    pairs = zip(cheap, measured, strict=True)
    return DeepOutputs([fit_mfdgp(few, high, CHOSEN) for few, high in pairs])
