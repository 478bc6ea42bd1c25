"""NARGP as published (Perdikaris et al. 2017): each level is a GP of the pose and the level below.

f_t(x) = g_t(x, f_{t−1}(x)) with g_t ~ GP(0, k_ρ(x, x') k_f(f(x), f(x')) + k_δ(x, x')), nothing in
front; all kernels RBF with a length scale per coordinate. Each level's hyperparameters are those
of the greatest likelihood, level after level, g_t trained at the posterior mean of the level below.
A prediction is the integral over the level below, by Gauss–Hermite quadrature with its mean and
variance, where the paper and emukit use Monte Carlo: the same integral without its noise.
AR1 as published (Kennedy & O'Hagan 2000), y = ρ·l(x) + δ(x), is the same with another kernel: ρ is
integrated over a normal prior whose width is climbed, which with a linear kernel in l is one GP.
AR1 in front, and averaged hyperparameters, are in `averaged`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.surrogate.models.fidelity_levels import FidelityLevel, Samples
from planner.surrogate.models.likelihood_gp import (
    STARTS,
    LikelihoodGP,
    Normalisation,
    fit_likelihood,
)

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


def perdikaris(d: int, shape: str = "rbf") -> str:
    """Kernel expression k_ρ(x) k_f(l) + k_δ(x) over the columns (x_1 … x_d, l)."""
    return f"{shape}[0:{d}]*{shape}[{d}:{d + 1}]+{shape}[0:{d}]"


def kennedy_ohagan(d: int) -> str:
    """Kernel expression σ² l l' + k_δ(x) over the same columns: AR1."""
    return f"linear[{d}:{d + 1}]+rbf[0:{d}]"


def fit_nargp(
    measured: Samples,
    low: FidelityLevel,
    low_units: Normalisation,
    noise: float | None = None,
    units: Normalisation | None = None,
    starts: int = STARTS,
    seed: int = 0,
    isotropic: bool = False,
    kernel: Callable[[int], str] = perdikaris,
) -> NARGP:
    """NARGP of the measured samples over a cheap level, which is fitted already or exact.

    Args:
        measured: expensive values at x (n, d).
        low: the cheap level.
        low_units: by what the cheap level's value is normalised as an input.
        noise, units, starts, seed, isotropic: as of `fit_likelihood`.
        kernel: `perdikaris`, or `kennedy_ohagan` for AR1.
    """
    below, _ = low.predict(measured.x)
    wide = Samples(widened(measured.x, below, low_units), measured.y, measured.sd)
    expression = kernel(measured.x.shape[1])
    high = fit_likelihood(wide, expression, noise, units, starts, seed, isotropic=isotropic)
    return NARGP(low, high, low_units)


def widened(x: np.ndarray, below: np.ndarray, units: Normalisation) -> np.ndarray:
    """x (n, d), and the value (n,) of the level below in its own units: (n, d + 1)."""
    return np.column_stack([x, (below - units.centre) / units.scale])
