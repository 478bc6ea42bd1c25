"""Exact GP of one output: any kernel expression, a noise per point, hyperparameters averaged."""

from dataclasses import dataclass

import numpy as np

from planner.surrogate.ar1 import OutputPrior
from planner.surrogate.gp import Posterior, Prior, fit
from planner.surrogate.kernels import parse
from planner.surrogate.marginal import laplace
from planner.surrogate.models.fidelity_levels import AveragedModel, Samples, spread
from planner.surrogate.predictive import Predictive
from planner.surrogate.training_data import TrainingData, pad

PRIOR = OutputPrior(bias_sd=1.0, slope_sd=0.0, amplitude=1.0, nugget=1e-3)  # of y scaled to sd 1
MANY = 64  # points; above, samples are fewer, for the hyperparameters are then well determined


@dataclass(frozen=True, eq=False)
class SingleGP(AveragedModel):
    """A GP averaged over hyperparameters, of y = centre + scale·(…)."""

    posterior: Posterior
    centre: float
    scale: float
    log_evidence: float

    def predictive(self, x: np.ndarray) -> Predictive:
        """The noise-free output at x (q, d), one Gaussian per sample of the hyperparameters."""
        return self.posterior.predictive(0, x, np.zeros(len(x))).scaled(self.centre, self.scale)


def fit_gp(
    samples: Samples, kernel: str = "matern52", prior: OutputPrior = PRIOR,
    scale: float | None = None,
) -> SingleGP:  # fmt: skip
    """GP of `samples`, x scaled to about [0, 1].

    `prior` is in units of `scale`, by default the sd of y.
    """
    n = len(samples.y)
    centre = float(np.mean(samples.y)) if n else 0.0
    scale = scale or spread(samples.y)
    y, sd = (samples.y - centre) / scale, samples.sd / scale
    data = TrainingData(samples.x, y[:, None], sd[:, None], np.full((n, 1), np.nan))
    mean, width = prior.of_theta(parse(kernel, samples.x.shape[1]))
    bias = np.full(1, prior.bias_sd)
    stacked = Prior(np.zeros(1), bias, np.zeros(1), mean[None, :], width[None, :])
    padded = pad(data, np.zeros(1, bool))
    start = laplace(kernel, padded, stacked)
    counts = (256, 32) if n <= MANY else (32, 4)
    posterior = fit(padded, stacked, *counts, kernel, 2, start)
    evidence = float(posterior.log_evidence[0]) - n * np.log(scale)
    return SingleGP(posterior, centre, scale, evidence)
