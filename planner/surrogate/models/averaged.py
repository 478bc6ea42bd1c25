"""One output, hyperparameters averaged: a GP, AR1, and AR1-NARGP, over a low level or none.

y = ȳ + s (ρ·l + b + δ(x)), l the low level's value, centred and scaled. The level below is fitted
once and kept: a new measurement refits the discrepancy alone (Le Gratiet & Garnier 2014). With a
low level that is known exactly this is the joint model of Kennedy & O'Hagan (2000). In AR1-NARGP
(not the published NARGP, see `nargp`) δ has the kernel k_ρ(x) k_f(l) + k_δ(x) of Perdikaris et al.
2017. Where the cheap level is uncertain, that is carried through by quadrature.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from planner.surrogate.ar1 import AR1, OutputPrior, fit_ar1
from planner.surrogate.models.fidelity_levels import FidelityLevel, Samples, spread
from planner.surrogate.models.nargp import perdikaris
from planner.surrogate.predictive import Predictive
from planner.surrogate.training_data import TrainingData

GP_PRIOR = OutputPrior(bias_sd=1.0, slope_sd=0.0, amplitude=1.0, nugget=1e-3)  # of y scaled to sd 1
# Simulations are off by a thousandth of what they vary or by all of it: hence the wide spread.
AR1_PRIOR = OutputPrior(bias_sd=0.5, slope_sd=1.0, amplitude=0.2, nugget=1e-3, spread=2.0)
ALIKE_COUNT = 2.0  # measurements' worth of belief that both levels vary by the same amount
MANY = 64  # points; above, samples are fewer, for the hyperparameters are then well determined
NODES = norm.ppf((np.arange(9) + 0.5) / 9)  # equally probable values of the cheap level
NODES = NODES / np.std(NODES)
CERTAIN = 1e-6  # sd of the cheap level over its scale, below which one value is enough


@dataclass(frozen=True, eq=False)
class AveragedModel:
    """Fitted to centred and scaled values: `model` is in these units; of (x, l) if it `sees_low`.

    `log_evidence` is log p(y | model) of the expensive samples.
    """

    low: FidelityLevel | None
    model: AR1
    low_centre: float
    low_scale: float
    centre: float
    scale: float
    log_evidence: float
    sees_low: bool = False

    def predictive(self, x: np.ndarray) -> Predictive:
        """The noise-free output at x (q, d), one Gaussian per sample of the hyperparameters."""
        low, sd = np.zeros(len(x)), np.zeros(len(x))
        if self.low is not None:
            value, unsure = self.low.predict(x)
            low, sd = (value - self.low_centre) / self.low_scale, unsure / self.low_scale
        nodes = NODES if np.max(sd, initial=0.0) > CERTAIN else np.zeros(1)
        low = (low[None, :] + nodes[:, None] * sd[None, :]).reshape(-1)
        wide = np.tile(x, (len(nodes), 1))
        wide = np.column_stack([wide, low]) if self.sees_low else wide
        base, offset = self.model.split(low[:, None])
        each = self.model.posterior.predictive(0, wide, offset[:, 0])
        shape = len(each.weights), len(nodes), len(x)
        means, sds = (each.means + base[:, 0]).reshape(shape), each.sds.reshape(shape)
        sds = np.sqrt(np.mean(sds**2, axis=1) + np.var(means, axis=1))
        moments = Predictive(each.weights, np.mean(means, axis=1), sds)
        return moments.scaled(self.centre, self.scale)

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Median and sd (q,) of the noise-free output at x (q, d)."""
        mixture = self.predictive(x)
        return mixture.median, mixture.sd


def fit_gp(
    samples: Samples, kernel: str = "matern52", prior: OutputPrior = GP_PRIOR,
    scale: float | None = None,
) -> AveragedModel:  # fmt: skip
    """GP of `samples`, x scaled to about [0, 1].

    `prior` is in units of `scale`, by default the sd of y.
    """
    return _fit(samples, None, None, kernel, prior, scale or spread(samples.y))


def fit_recursive(
    measured: Samples, low: FidelityLevel, low_spread: float, kernel: str = "matern52",
    prior: OutputPrior = AR1_PRIOR,
) -> AveragedModel:  # fmt: skip
    """AR1 of the measured samples; `low_spread` is the sd of the low level over the workspace."""
    return _fit(measured, low, low_spread, kernel, prior)


def fit_ar1_nargp(
    measured: Samples, low: FidelityLevel, low_spread: float, kernel: str = "product",
    prior: OutputPrior = AR1_PRIOR,
) -> AveragedModel:  # fmt: skip
    """AR1-NARGP of the measured samples; `kernel` over (x, l), or "product": `perdikaris`."""
    expression = perdikaris(measured.x.shape[1]) if kernel == "product" else kernel
    return _fit(measured, low, low_spread, expression, prior, sees_low=True)


def _fit(
    measured: Samples, low: FidelityLevel | None, low_spread: float | None, kernel: str,
    prior: OutputPrior, scale: float = 1.0, sees_low: bool = False,
) -> AveragedModel:  # fmt: skip
    n, low_scale, low_centre = len(measured.y), 1.0, 0.0
    value, unsure = np.full(n, np.nan), np.zeros(n)
    if low is not None and low_spread is not None:
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
    middle = np.full(1, np.nan if low is None else 0.0)
    counts = (256, 32) if n <= MANY or low is not None else (32, 4)
    model = fit_ar1(data, (prior,), (prior,), middle, *counts, kernel=kernel, thorough=True)
    evidence = float(model.posterior.log_evidence[0]) - n * np.log(scale)
    return AveragedModel(
        low, model, low_centre, low_scale, centre, scale, evidence, sees_low
    )  # fmt: skip


def scales(y: np.ndarray, low: np.ndarray, low_spread: float) -> tuple[float, float]:
    """Sd of the low level, and what stands for the output's own.

    The output's is the low level's, corrected by how much more it varies over the measured poses,
    shrunk towards no correction where these are few.
    """
    more = np.log(spread(y) / spread(low)) if len(y) > 1 else 0.0
    shrunk = (len(y) - 1) / (len(y) - 1 + ALIKE_COUNT) * more if len(y) > 1 else 0.0
    return low_spread, low_spread * float(np.exp(shrunk))
