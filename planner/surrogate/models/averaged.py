"""One output, hyperparameters averaged: a GP, AR1, and AR1-NARGP, over a simulation or none.

y = ȳ + s (ρ·l + b + δ(x)), l the simulation's value, centred and scaled. In AR1-NARGP (not the
published NARGP, see `likelihood_gp`) δ has the kernel k_ρ(x) k_f(l) + k_δ(x) of Perdikaris et al.
2017.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import elementwise
from scipy.special import ndtr

from planner.surrogate.ar1 import AR1, FusionData, OutputPrior, fit_ar1
from planner.surrogate.models.likelihood_gp import (
    Exact,
    Normalisation,
    Samples,
    spread,
    widened,
)
from planner.surrogate.training_data import TrainingData

GP_PRIOR = OutputPrior(bias_sd=1.0, slope_sd=0.0, amplitude=1.0, nugget=1e-3)  # of y scaled to sd 1
# Simulations are off by a thousandth of what they vary or by all of it: hence the wide spread.
AR1_PRIOR = OutputPrior(bias_sd=0.5, slope_sd=1.0, amplitude=0.2, nugget=1e-3, spread=2.0)
ALIKE_COUNT = 2.0  # measurements' worth of belief that both levels vary by the same amount
MANY = 64  # points; above, samples are fewer, for the hyperparameters are then well determined
REACH = 8.0  # sds of every Gaussian of a mixture within which its median is


@dataclass(frozen=True, eq=False)
class AveragedModel:
    """Fitted to normalised values, of (x, l) if it `sees_low`."""

    low: Exact | None
    model: AR1
    low_units: Normalisation
    units: Normalisation
    sees_low: bool = False

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Median and sd (q,) of the noise-free output at x (q, d).

        The median is nearer to the truth than the mean where a few samples of the hyperparameters
        stray far.
        """
        below = np.full(len(x), np.nan) if self.low is None else self.low.predict(x)[0]
        base, offset, _ = self.model.split(self.low_units.normalised(below)[:, None])
        x = widened(x, below, self.low_units) if self.sees_low else x
        means, variances = self.model.outputs[0].predictive(x, offset[:, 0])
        sds = np.sqrt(np.maximum(variances, np.finfo(float).tiny))
        ends = np.min(means - REACH * sds, axis=0), np.max(means + REACH * sds, axis=0)
        median = elementwise.find_root(
            lambda y, i: np.mean(ndtr((y - means[:, i]) / sds[:, i]), axis=0) - 0.5,
            ends,
            args=(np.arange(len(x)),),
        ).x
        sd = np.sqrt(np.mean(variances, axis=0) + np.var(means, axis=0))
        return self.units.restored(median + base[:, 0], sd)


def fit_averaged(
    measured: Samples, kernel: str = "matern52", low: Exact | None = None, low_spread: float = 1.0,
    sees_low: bool = False,
) -> AveragedModel:  # fmt: skip
    """GP of measured samples, x scaled to about [0, 1], or AR1 over a simulation `low`.

    `low_spread` is the sd of the simulation over the workspace. If it `sees_low`, the kernel is
    over (x, l): `perdikaris` makes it AR1-NARGP.
    """
    n, centre = len(measured.y), float(np.mean(measured.y)) if len(measured.y) else 0.0
    if low is None:
        value, low_units, prior = np.full(n, np.nan), Normalisation(0.0, 1.0), GP_PRIOR
        units = Normalisation(centre, spread(measured.y))
    else:
        value, prior = low.predict(measured.x)[0], AR1_PRIOR
        low_units = Normalisation(float(np.mean(value)) if n else 0.0, low_spread)
        units = Normalisation(centre, low_spread * _times_more(measured.y, value))
    data = TrainingData(
        widened(measured.x, value, low_units) if sees_low else measured.x,
        units.normalised(measured.y)[:, None],
        (measured.sd / units.scale)[:, None],
        low_units.normalised(value)[:, None],
    )
    middle = np.full(1, np.nan if low is None else 0.0)
    counts = (256, 32) if n <= MANY or low is not None else (32, 4)
    model = fit_ar1(FusionData(data, (prior,), (prior,), middle), *counts, kernel, thorough=True)
    return AveragedModel(low, model, low_units, units, sees_low)


def _times_more(y: np.ndarray, low: np.ndarray) -> float:
    """By how much more the output varies over the measured poses than the simulation.

    Shrunk towards no difference where these are few.
    """
    if len(y) < 2:
        return 1.0
    share = (len(y) - 1) / (len(y) - 1 + ALIKE_COUNT)
    return float(np.exp(share * np.log(spread(y) / spread(low))))
