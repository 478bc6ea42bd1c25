"""AR1 of one output over a low level that may itself be uncertain (Le Gratiet & Garnier 2014).

y = ȳ + s (ρ·l + b + δ(x)), l the low level's value, centred and scaled. The level below is fitted
once and kept: a new measurement refits the discrepancy alone. With a low level that is known
exactly this is the joint model of Kennedy & O'Hagan (2000).
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from planner.surrogate.ar1 import AR1, OutputPrior, fit_ar1
from planner.surrogate.models.fidelity_levels import AveragedModel, FidelityLevel, Samples, spread
from planner.surrogate.predictive import Predictive
from planner.surrogate.training_data import TrainingData

# Simulations are off by a thousandth of what they vary or by all of it: hence the wide spread.
PRIOR = OutputPrior(bias_sd=0.5, slope_sd=1.0, amplitude=0.2, nugget=1e-3, spread=2.0)
ALIKE_COUNT = 2.0  # measurements' worth of belief that both levels vary by the same amount


@dataclass(frozen=True, eq=False)
class ScaledAR1(AveragedModel):
    """AR1 over a low level, fitted to centred and scaled values: `model` is in these units."""

    low: FidelityLevel
    model: AR1
    low_centre: float
    low_scale: float
    centre: float
    scale: float
    log_evidence: float

    @classmethod
    def fit(
        cls, measured: Samples, low: FidelityLevel, low_spread: float, kernel: str,
        prior: OutputPrior,
        sees_low: bool = False,
    ) -> Self:  # fmt: skip
        """Fit the measured samples.

        Args:
            measured: expensive values at x (n, d).
            low: the cheap level.
            low_spread: sd of the low level over the workspace.
            kernel: expression of the discrepancy's kernel.
            prior: of the discrepancy, in units of the output's scale.
            sees_low: whether the kernel's columns are (x, l) instead of x.
        """
        n = len(measured.y)
        value, unsure = low.predict(measured.x)
        low_centre = float(np.mean(value)) if n else 0.0
        low_scale, scale = scales(measured.y, value, low_spread)
        centre = float(np.mean(measured.y)) if n else 0.0
        scaled = (value - low_centre) / low_scale
        data = TrainingData(
            np.column_stack([measured.x, scaled]) if sees_low else measured.x,
            ((measured.y - centre) / scale)[:, None],
            np.hypot(measured.sd / scale, unsure / low_scale)[:, None],
            scaled[:, None],
        )
        model = fit_ar1(data, (prior,), (prior,), np.zeros(1), kernel=kernel, thorough=True)
        evidence = float(model.posterior.log_evidence[0]) - n * np.log(scale)
        return cls(low, model, low_centre, low_scale, centre, scale, evidence)

    def scaled_low(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The low level and its sd (q,) at x (q, d), centred and scaled."""
        value, unsure = self.low.predict(x)
        return (value - self.low_centre) / self.low_scale, unsure / self.low_scale


class RecursiveAR1(ScaledAR1):
    """Fitted by `fit_recursive`; the low level's uncertainty is added, times the slope."""

    def predictive(self, x: np.ndarray) -> Predictive:
        """The noise-free output at x (q, d), one Gaussian per sample of the hyperparameters."""
        low, unsure = self.scaled_low(x)
        base, offset = self.model.split(low[:, None])
        discrepancy = self.model.posterior.predictive(0, x, offset[:, 0])
        slope = np.abs(1 + self.model.posterior.slopes(0))
        discrepancy = discrepancy.widened(slope[:, None] * unsure[None, :])
        means = discrepancy.means + base[:, 0]
        return Predictive(discrepancy.weights, means, discrepancy.sds).scaled(
            self.centre, self.scale
        )


def fit_recursive(
    measured: Samples, low: FidelityLevel, low_spread: float, kernel: str = "matern52",
    prior: OutputPrior = PRIOR,
) -> RecursiveAR1:  # fmt: skip
    """AR1 of the measured samples; `low_spread` is the sd of the low level over the workspace."""
    return RecursiveAR1.fit(measured, low, low_spread, kernel, prior)


def scales(y: np.ndarray, low: np.ndarray, low_spread: float) -> tuple[float, float]:
    """Sd of the low level, and what stands for the output's own.

    The output's is the low level's, corrected by how much more it varies over the measured poses,
    shrunk towards no correction where these are few.
    """
    more = np.log(spread(y) / spread(low)) if len(y) > 1 else 0.0
    shrunk = (len(y) - 1) / (len(y) - 1 + ALIKE_COUNT) * more if len(y) > 1 else 0.0
    return low_spread, low_spread * float(np.exp(shrunk))
