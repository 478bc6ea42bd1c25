"""AR1 of many outputs over a simulation that is known exactly at every pose.

y_H(x) = ρ·y_L(x) + b + δ(x) (Kennedy & O'Hagan 2000; seed 000, section 2.3.1). The simulation is
deterministic and costs milliseconds, so the low-fidelity level is evaluated, not modelled. An
output without simulation is a plain GP: the same with no ρ·y_L.
"""

from dataclasses import dataclass

import numpy as np

from planner.fusion.data import TrainingData, pad
from planner.fusion.gp import Posterior, Prior, fit


@dataclass(frozen=True)
class OutputPrior:
    """Weakly informative prior of one kind of output, in the output's own unit.

    Medians of amplitude σ of δ and of the nugget τ, with log-sd `spread` each; length scales have
    median `length`·√d in coordinates scaled to [0, 1]. `mean` applies without simulation only.
    """

    bias_sd: float
    slope_sd: float
    amplitude: float
    nugget: float
    mean: float = 0.0
    length: float = 0.8
    spread: float = 1.0


@dataclass(frozen=True, eq=False)
class AR1:
    """Fitted outputs; `uses_low` (m,): which stand on the simulation; `centre` (m,): its mean."""

    posterior: Posterior
    uses_low: np.ndarray
    centre: np.ndarray

    def predict(self, x: np.ndarray, low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, m) at x (q, d), simulation low (q, m) (NaN: unknown there)."""
        base, offset = self.split(low)
        mean, sd = self.posterior.predict(x, offset)
        return mean + base, sd

    def split(self, low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What ρ = 1 predicts, and the centred value that ρ − 1 multiplies; (q, m) each."""
        known = np.where(np.isfinite(low), low, self.centre[None, :])
        base = np.where(self.uses_low[None, :], known, 0.0)
        return base, np.where(self.uses_low[None, :], known - self.centre[None, :], 0.0)


def fit_ar1(
    data: TrainingData,
    with_low: tuple[OutputPrior, ...],
    without_low: tuple[OutputPrior, ...],
    centre: np.ndarray,
    samples: int = 256,
    kept: int = 32,
    kernel: str = "matern52",
) -> AR1:
    """Fit m outputs; per output its prior with and without simulation, and y_L's `centre` (m,)."""
    n, d = data.x.shape
    # With no measurement yet the simulation, where there is one, is all there is to stand on.
    uses_low = np.all(np.isfinite(data.low), axis=0) if n else np.isfinite(centre)
    centre = np.where(uses_low, np.nan_to_num(centre), 0.0)
    priors = [a if u else b for a, b, u in zip(with_low, without_low, uses_low, strict=True)]
    base = np.where(uses_low[None, :], data.low, 0.0)
    offset = np.where(uses_low[None, :], data.low - centre[None, :], 0.0)
    padded = pad(TrainingData(data.x, data.y - base, data.sd, offset), uses_low)
    posterior = fit(padded, _stack(priors, uses_low, d), samples, kept, kernel)
    return AR1(posterior, uses_low, centre)


def _stack(priors: list[OutputPrior], uses_low: np.ndarray, d: int) -> Prior:
    logs = np.array([[np.log(p.amplitude), np.log(p.nugget)] for p in priors])
    length = np.array([np.log(p.length * np.sqrt(max(d, 1))) for p in priors])
    spread = np.array([p.spread for p in priors])
    m = len(priors)
    return Prior(
        mean=np.array([p.mean for p in priors]) * ~uses_low,
        bias_sd=np.array([p.bias_sd for p in priors]),
        slope_sd=np.array([p.slope_sd for p in priors]) * uses_low,
        theta_mean=np.concatenate([logs, np.tile(length[:, None], (1, d))], axis=1),
        theta_sd=np.concatenate(
            [np.tile(spread[:, None], (1, 2)), np.full((m, d), 0.8)], axis=1
        ),
    )  # fmt: skip
