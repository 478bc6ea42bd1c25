"""GPs of one output as they are usually published: hyperparameters of the greatest likelihood.

y ~ N(0, K + τ² I); log p(y | θ) = −½ yᵀ(K + τ²I)⁻¹y − ½ log|K + τ²I| − (n/2) log 2π (Rasmussen &
Williams 2006, eq. 5.8) is climbed from several starts, the best taken; no prior, no averaging.
Predictions are eqs. 2.23 and 2.24 there. With few points this is over-confident (`averaged`
averages instead): it is here because the papers do so.

NARGP (Perdikaris et al. 2017): each level is a GP of the pose and the level below,
f_t(x) = g_t(x, f_{t−1}(x)) with g_t ~ GP(0, k_ρ(x, x') k_f(f(x), f(x')) + k_δ(x, x')), nothing in
front; all kernels RBF with a length scale per coordinate, level after level, g_t trained at the
posterior mean of the level below. A prediction is the integral over the level below, by
Gauss–Hermite quadrature with its mean and variance, where the paper and emukit use Monte Carlo: the
same integral without its noise. AR1 as published (Kennedy & O'Hagan 2000), y = ρ·l(x) + δ(x), is
the same with another kernel: ρ is integrated over a normal prior whose width is climbed, which with
a linear kernel in l is one GP.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.stats import qmc

from planner.errors import InputError
from planner.inference.per_pose import PerPose
from planner.surrogate.kernels import parse, perdikaris
from planner.surrogate.likelihood import RELATIVE_TOLERANCE, Peak, log_likelihood, maximise
from planner.surrogate.training_data import capacity

# Of log θ: amplitudes and length scales from 1e-3 to 1e5 in units of y's and x's own scale.
LOWEST, HIGHEST = float(np.log(1e-3)), float(np.log(1e5))
LENGTH = 0.4  # length scales from which a climb begins, times √d; x is scaled to about [0, 1]
# Of starts everywhere: length scales of x, amplitudes over y's scale.
LENGTHS, AMPLITUDES = (0.02, 2.0), (0.2, 5.0)
LEAST_NOISE = 1e-4  # sd over y's scale, where the noise is fitted
JITTER = 1e-8  # variance over y's scale squared, as GPy adds it
# Noise that is known and small leaves K + τ²I so ill-conditioned far from the peak that a first
# step ends where every point stands alone: most climbs begin with more noise, then with less.
# Too much of it at first leads them all to one peak: so each start begins one level further on.
NOISES = (0.5, 0.1, 0.01)
# Steps, and the relative gain after which a climb ends: of every start at first; the LAST likeliest
# of them go on to the end.
ROUGHLY, LAST = (60, 1e-5), 2
MOST_STEPS, FEW_STEPS = 200, 60  # of a climb to the end; of one that begins at fewer points' peak
FTOL = 1e-7  # of the latter: less of the log-likelihood changes no prediction
# Log-densities further apart are those of different peaks; so many are followed to more points.
SAME_PEAK, MOST_PEAKS = 0.5, 4
STARTS = 5  # "five optimization runs" (Busch et al. 2022, section 2.3.1)


@dataclass(frozen=True, eq=False)
class Samples(PerPose):
    """n values of one output: x (n, d), scaled to about [0, 1], y (n,) and its sd (n,)."""

    x: np.ndarray
    y: np.ndarray
    sd: np.ndarray

    @classmethod
    def of(cls, x: np.ndarray, y: np.ndarray, sd: np.ndarray | float = 0.0) -> "Samples":
        """The finite ones; an sd of 0 (or NaN) leaves all noise to the nugget."""
        x = np.atleast_2d(np.asarray(x, dtype=float))
        y = np.asarray(y, dtype=float)
        if x.shape[0] != len(y):
            raise InputError(f"{len(y)} values at {x.shape[0]} poses: give one value per pose.")
        sd = np.broadcast_to(np.nan_to_num(np.asarray(sd, dtype=float)), y.shape)
        return cls(x, y, sd)[np.isfinite(y) & np.isfinite(x).all(axis=1)]


class FidelityLevel(Protocol):
    """What predicts one output with its uncertainty: a simulation or a fitted model."""

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Best estimate and sd (q,) of the noise-free output at x (q, d)."""
        ...


@dataclass(frozen=True)
class Exact:
    """A simulation that can be evaluated at every pose: values (q,) of x (q, d)."""

    function: Callable[[np.ndarray], np.ndarray]

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Its value (q,), with sd 0."""
        value = np.asarray(self.function(x), dtype=float)
        return value, np.zeros_like(value)


def spread(y: np.ndarray) -> float:
    """Sd of y, 1 where it is unknown (fewer than two values) or 0."""
    sd = float(np.std(y)) if len(y) > 1 else 0.0
    size = float(np.max(np.abs(y), initial=0.0))
    return sd if sd > 1e-12 * max(size, 1e-300) else 1.0


@dataclass(frozen=True, eq=False)
class Normalisation:
    """y is modelled as (y − centre) / scale."""

    centre: float
    scale: float

    @classmethod
    def of(cls, y: np.ndarray) -> "Normalisation":
        """Mean and sd of y."""
        return cls(float(np.mean(y)), spread(y))

    def normalised(self, y: np.ndarray) -> np.ndarray:
        """y in these units."""
        return (y - self.centre) / self.scale

    def restored(self, mean: np.ndarray, sd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd in y's own unit."""
        return self.centre + self.scale * mean, self.scale * sd


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
        return self.units.restored(self.alpha @ cross, sd)


def fit_likelihood(
    samples: Samples,
    kernel: str = "rbf",
    noise: float | None = None,
    units: Normalisation | None = None,
    starts: int = STARTS,
    isotropic: bool = False,
) -> LikelihoodGP:
    """Maximum-likelihood GP of `samples`.

    Args:
        samples: x (n, d) scaled to about [0, 1] and y (n,); sds are not looked at.
        kernel: an expression over the columns of x.
        noise: τ over y's scale, where it is known; None: it is fitted.
        units: by what y is normalised; None: its own mean and sd.
        starts: how many; the first is in the middle, the others random around it.
        isotropic: one length scale for all columns of a factor (Busch et al. 2022, eqs. 4 to 7).
    """
    units = units or Normalisation.of(samples.y)
    hill = _Hill.of(samples, kernel, noise, units, isotropic)
    ends = sorted(hill.roughly(starts, noise), key=lambda peak: -peak.log_density)[:LAST]
    best = max((hill.climb(e.x) for e in ends), key=lambda peak: peak.log_density)
    return at_hyperparameters(samples, kernel, best.x[hill.own], units)


def fit_growing(
    samples: Samples, counts: Sequence[int], kernel: str = "rbf", starts: int = STARTS
) -> LikelihoodGP:
    """Maximum-likelihood GP of many samples, over all of which a climb from afar takes minutes.

    Climbs begin with some of the points, which costs next to nothing; every peak found there leads
    to one of more points, for the likeliest of few need not lead to the likeliest of all. `counts`
    are so many points, drawn at random, before all of them; `starts` the climbs over the first.
    """
    order, units = np.random.default_rng(0).permutation(len(samples.y)), Normalisation.of(samples.y)
    peaks: list[Peak] = []
    for count in (*counts, len(order)):
        hill = _Hill.of(samples[order[:count]], kernel, None, units, isotropic=False)
        if not peaks:
            ends = [hill.climb(z, *ROUGHLY) for z in hill.everywhere(starts)]
        else:
            # The likeliest of few points may be the seventh of all: only the last step is dear.
            rest = peaks if count < len(order) else peaks[:MOST_PEAKS]
            ends = [hill.climb(peak.x, FEW_STEPS, FTOL) for peak in rest]
        peaks = _most_probable(ends)
    return at_hyperparameters(samples, kernel, peaks[0].x, units)


def _most_probable(ends: Sequence[Peak]) -> list[Peak]:
    """Those of different density, the likeliest first."""
    found: list[Peak] = []
    for end in sorted(ends, key=lambda peak: -peak.log_density):
        if not found or found[-1].log_density - end.log_density > SAME_PEAK:
            found.append(end)
    return found


@dataclass(frozen=True, eq=False)
class _Hill:
    """A log-likelihood over the parameters z that are climbed: θ = z[own], z = θ[kept]."""

    kernel: str
    count: int
    data: tuple[np.ndarray, ...]  # as `log_likelihood` wants them, padded to few sizes
    own: np.ndarray
    kept: np.ndarray
    middle: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @classmethod
    def of(
        cls, samples: Samples, kernel: str, noise: float | None, units: Normalisation,
        isotropic: bool,
    ) -> "_Hill":  # fmt: skip
        x, y = samples.x, units.normalised(samples.y)
        own = _free(kernel, x.shape[1], isotropic)
        kept = np.unique(own, return_index=True)[1]
        middle = parse(kernel, x.shape[1]).prior(1.0, NOISES[0], LENGTH, 0.0, 0.0)[0][kept]
        lower, upper = np.full(len(kept), LOWEST), np.full(len(kept), HIGHEST)
        lower[1] = np.log(LEAST_NOISE if noise is None else noise)
        upper[1] = 0.0 if noise is None else lower[1]
        more = capacity(len(x)) - len(x)
        mask, none = np.pad(np.ones(len(x)), (0, more)), np.zeros(capacity(len(x)))
        x, y = np.pad(x, [(0, more), (0, 0)]), np.pad(y, (0, more))
        data = x, y, none, mask, none + JITTER, np.zeros(()), np.zeros(())
        return cls(kernel, len(samples.y), data, own, kept, middle, lower, upper)

    def everywhere(self, count: int) -> np.ndarray:
        """Evenly over all that is plausible (count, …), by Halton's sequence: of climbs from the
        middle alone the likeliest may be far from the greatest likelihood."""
        kernel = parse(self.kernel, self.data[0].shape[1])
        low, high = np.tile(np.log(LENGTHS), (kernel.size, 1)).T
        low[list(kernel.amplitudes)], high[list(kernel.amplitudes)] = np.log(AMPLITUDES)
        low[1], high[1] = np.log(NOISES[-1]), np.log(NOISES[0])
        even = qmc.Halton(len(self.kept), rng=0).random(count)
        return low[self.kept] + even * (high - low)[self.kept]

    def roughly(self, starts: int, noise: float | None) -> list[Peak]:
        """Where climbs end roughly: from the middle, and from starts that are normal around it."""
        around = np.zeros((starts, len(self.kept)))
        around[1:] = np.random.default_rng(0).standard_normal((starts - 1, len(self.kept)))
        levels = NOISES[:1] if noise is None else [level for level in NOISES if level > noise]
        ends = []
        for i, z in enumerate(self.middle + around):
            for held in levels[i % (len(levels) + 1) :]:
                z = self.climb(z, *ROUGHLY, held).x
            ends.append(self.climb(z, *ROUGHLY))
        return ends

    def density(self, z: np.ndarray) -> tuple[float, np.ndarray]:
        """log p(y) and its slope in z."""
        value, slope = log_likelihood(self.kernel, z[self.own], 0.0, *self.data)
        constant = 0.5 * self.count * np.log(2 * np.pi)
        return float(value) - constant, np.bincount(self.own, slope)

    def climb(
        self, z: np.ndarray, steps: int = MOST_STEPS, ftol: float = RELATIVE_TOLERANCE,
        noise: float | None = None,
    ) -> Peak:  # fmt: skip
        """Where L-BFGS ends from z; with `noise` held there."""
        lower, upper = self.lower.copy(), self.upper.copy()
        if noise is not None:
            lower[1] = upper[1] = np.log(noise)
        return maximise(self.density, [np.clip(z, lower, upper)], lower, upper, steps, ftol)


def at_hyperparameters(
    samples: Samples, kernel: str, theta: np.ndarray, units: Normalisation
) -> LikelihoodGP:
    """The GP of `samples` with given hyperparameters (p,), log τ in their second place."""
    y = units.normalised(samples.y)
    k = parse(kernel, samples.x.shape[1]).covariance(np, theta, samples.x, samples.x)
    root = np.linalg.cholesky(k + (np.exp(2 * theta[1]) + JITTER) * np.eye(len(y)))
    white = solve_triangular(root, y, lower=True)
    size = np.sum(np.log(np.diag(root))) + len(y) * (0.5 * np.log(2 * np.pi) + np.log(units.scale))
    value = float(-0.5 * white @ white - size)
    return LikelihoodGP(kernel, theta, samples.x, root, cho_solve((root, True), y), units, value)


def _free(kernel: str, d: int, isotropic: bool) -> np.ndarray:
    """Which parameter that is climbed each of θ (p,) is."""
    parsed = parse(kernel, d)
    first = np.arange(parsed.size)
    for factor in (f for term in parsed.terms for f in term):
        if isotropic and factor.scales.stop > factor.scales.start:
            first[factor.scales] = factor.scales.start
    return np.unique(first, return_inverse=True)[1]


NODE_COUNT = 21  # of the quadrature: exact for polynomials of degree 41
NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(NODE_COUNT)
WEIGHTS = WEIGHTS / WEIGHTS.sum()


@dataclass(frozen=True, eq=False)
class NARGP:
    """Fitted by `fit_nargp`: the level below, and g of (x, f_low)."""

    low: FidelityLevel
    high: LikelihoodGP
    low_units: Normalisation

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q,) of the noise-free expensive output at x (q, d)."""
        below, unsure = self.low.predict(x)
        nodes = below[None, :] + NODES[:, None] * unsure[None, :]
        wide = widened(np.tile(x, (NODE_COUNT, 1)), nodes.reshape(-1), self.low_units)
        mean, sd = (part.reshape(NODE_COUNT, len(x)) for part in self.high.predict(wide))
        middle = WEIGHTS @ mean
        return middle, np.sqrt(WEIGHTS @ (sd**2 + (mean - middle) ** 2))


def fit_nargp(
    measured: Samples,
    low: FidelityLevel,
    low_units: Normalisation,
    kernel: Callable[[int], str] = perdikaris,
    **how: Any,
) -> NARGP:
    """NARGP of the measured samples over a cheap level, which is fitted already or exact.

    Args:
        measured: expensive values at x (n, d).
        low: the cheap level.
        low_units: by what the cheap level's value is normalised as an input.
        kernel: `perdikaris`, or `kennedy_ohagan` for AR1.
        how: as of `fit_likelihood`.
    """
    below, _ = low.predict(measured.x)
    wide = Samples(widened(measured.x, below, low_units), measured.y, measured.sd)
    high = fit_likelihood(wide, kernel(measured.x.shape[1]), **how)
    return NARGP(low, high, low_units)


def widened(x: np.ndarray, below: np.ndarray, units: Normalisation) -> np.ndarray:
    """x (n, d), and the value (n,) of the level below in its own units: (n, d + 1)."""
    return np.column_stack([x, units.normalised(below)])
