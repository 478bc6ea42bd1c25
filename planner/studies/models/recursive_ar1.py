"""AR1 of one output over a low level that may itself be uncertain (Le Gratiet & Garnier 2014).

y = ȳ + s (ρ·l + b + δ(x)), l the low level's value, centred and scaled. The level below is fitted
once and kept: a new measurement refits the discrepancy alone. With a low level that is known
exactly this is the joint model of Kennedy & O'Hagan (2000).
"""

from dataclasses import dataclass

import numpy as np

from planner.studies.models.fidelity_levels import LowLevel, Samples, spread
from planner.surrogate.ar1 import AR1, OutputPrior, fit_ar1
from planner.surrogate.predictive import Predictive
from planner.surrogate.training_data import TrainingData

# Simulations are off by a thousandth of what they vary or by all of it: hence the wide spread.
PRIOR = OutputPrior(bias_sd=0.5, slope_sd=1.0, amplitude=0.2, nugget=1e-3, spread=2.0)
TRUST = 2.0  # measurements' worth of belief that both levels vary by the same amount


@dataclass(frozen=True, eq=False)
class RecursiveAR1:
    """Fitted; `model` is in scaled units."""

    low: LowLevel
    model: AR1
    low_centre: float
    low_scale: float
    centre: float
    scale: float
    log_evidence: float

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Median and sd (q,) of the noise-free output at x (q, d)."""
        found = self.predictive(x)
        return found.median, found.sd

    def predictive(self, x: np.ndarray) -> Predictive:
        """The same, one Gaussian per sample of the hyperparameters."""
        value, unsure = self.low.predict(x)
        scaled = (value - self.low_centre) / self.low_scale
        base, offset = self.model.split(scaled[:, None])
        found = self.model.posterior.predictive(0, x, offset[:, 0])
        slope = np.abs(1 + self.model.posterior.slopes(0))
        found = found.widened(slope[:, None] * unsure[None, :] / self.low_scale)
        shifted = Predictive(found.weights, found.means + base[:, 0], found.sds)
        return shifted.scaled(self.centre, self.scale)


def fit_recursive(
    measured: Samples, low: LowLevel, low_spread: float, kernel: str = "matern52",
    prior: OutputPrior = PRIOR,
) -> RecursiveAR1:  # fmt: skip
    """AR1 of the measured samples; `low_spread` is the sd of the low level over the workspace."""
    n = len(measured.y)
    value, unsure = low.predict(measured.x)
    low_centre = float(np.mean(value)) if n else 0.0
    low_scale, scale = scales(measured.y, value, low_spread)
    centre = float(np.mean(measured.y)) if n else 0.0
    sd = np.hypot(measured.sd / scale, unsure / low_scale)
    data = TrainingData(
        measured.x,
        ((measured.y - centre) / scale)[:, None],
        sd[:, None],
        ((value - low_centre) / low_scale)[:, None],
    )
    model = fit_ar1(data, (prior,), (prior,), np.zeros(1), kernel=kernel, thorough=True)
    evidence = float(model.posterior.log_evidence[0]) - n * np.log(scale)
    return RecursiveAR1(low, model, low_centre, low_scale, centre, scale, evidence)


def scales(y: np.ndarray, low: np.ndarray, low_spread: float) -> tuple[float, float]:
    """Sd of the low level, and what stands for the output's own.

    The output's is the low level's, corrected by how much more it varies over the measured poses,
    as far as these are enough to tell.
    """
    more = np.log(spread(y) / spread(low)) if len(y) > 1 else 0.0
    shrunk = (len(y) - 1) / (len(y) - 1 + TRUST) * more if len(y) > 1 else 0.0
    return low_spread, low_spread * float(np.exp(shrunk))
