"""AR1 as one Gaussian process over both levels (Kennedy & O'Hagan 2000, eq. 2 and 3): a reference.

cov(y_L, y_L') = k_L, cov(y_H, y_L') = ρ k_L, cov(y_H, y_H') = ρ² k_L + k_δ. Where the cheap points
include the expensive ones and carry no noise, this is the recursive form (`recursive`), which
costs a fraction of it (Le Gratiet & Garnier 2014, proposition 1).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from planner.surrogate.kernels import parse
from planner.surrogate.models.fidelity_levels import Samples


@dataclass(frozen=True)
class Hyperparameters:
    """Kernels over d columns and their θ (see `kernels.Kernel`), ρ, and the sds of both biases.

    θ's second entry is the log of the level's nugget τ.
    """

    low_kernel: str
    low_theta: np.ndarray
    delta_kernel: str
    delta_theta: np.ndarray
    slope: float
    low_bias_sd: float = 1.0
    bias_sd: float = 1.0


@dataclass(frozen=True, eq=False)
class JointAR1:
    """Both levels' samples, and K⁻¹ as a factor, at given hyperparameters."""

    low: Samples
    high: Samples
    h: Hyperparameters
    factor: tuple[np.ndarray, bool]
    alpha: np.ndarray
    log_evidence: float

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q,) of the noise-free expensive output at x (q, d)."""
        below, delta = _levels(self.h, x, x)
        own = np.diag(self.h.slope**2 * below + delta)
        cross = np.vstack([
            self.h.slope * _levels(self.h, self.low.x, x)[0],
            _expensive(self.h, self.high.x, x),
        ])  # fmt: skip
        variance = own - np.sum(cross * cho_solve(self.factor, cross), axis=0)
        return cross.T @ self.alpha, np.sqrt(np.maximum(variance, 0.0))


def condition_joint(low: Samples, high: Samples, h: Hyperparameters) -> JointAR1:
    """The process of `h`, given both levels' samples; zero prior mean."""
    ll = _levels(h, low.x, low.x)[0] + np.diag(low.sd**2 + np.exp(2 * h.low_theta[1]))
    lh = h.slope * _levels(h, low.x, high.x)[0]
    hh = _expensive(h, high.x, high.x) + np.diag(high.sd**2 + np.exp(2 * h.delta_theta[1]))
    y = np.concatenate([low.y, high.y])
    factor = cho_factor(np.block([[ll, lh], [lh.T, hh]]), lower=True)
    alpha = cho_solve(factor, y)
    size = 2 * np.sum(np.log(np.diag(factor[0]))) + len(y) * np.log(2 * np.pi)
    return JointAR1(low, high, h, factor, alpha, float(-0.5 * (y @ alpha + size)))


def _levels(h: Hyperparameters, xa: np.ndarray, xb: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """k_L and k_δ (a, b), biases included."""
    d = xa.shape[1]
    below = parse(h.low_kernel, d).covariance(np, h.low_theta, xa, xb) + h.low_bias_sd**2
    return below, parse(h.delta_kernel, d).covariance(np, h.delta_theta, xa, xb) + h.bias_sd**2


def _expensive(h: Hyperparameters, xa: np.ndarray, xb: np.ndarray) -> np.ndarray:
    below, delta = _levels(h, xa, xb)
    return h.slope**2 * below + delta
