"""Exact GP of one output: any kernel expression, a noise per point, hyperparameters averaged."""

from dataclasses import dataclass

import numpy as np

from planner.fusion.data import TrainingData, pad
from planner.fusion.gp import Posterior, Prior, fit
from planner.fusion.kernels import parse
from planner.fusion.levels import Samples, spread
from planner.fusion.marginal import laplace

BIAS_SD, AMPLITUDE, NUGGET, LENGTH, SPREAD = 1.0, 1.0, 1e-3, 0.8, 1.0  # of y scaled to sd 1
MANY = 64  # points; above, samples are fewer, for the hyperparameters are then well determined


@dataclass(frozen=True, eq=False)
class SingleGP:
    """A GP averaged over hyperparameters, of y = centre + scale·(…)."""

    posterior: Posterior
    centre: float
    scale: float
    log_evidence: float

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q,) of the noise-free output at x (q, d)."""
        mean, sd = self.posterior.predict(x, np.zeros((len(x), 1)))
        return self.centre + self.scale * mean[:, 0], self.scale * sd[:, 0]


def fit_gp(
    samples: Samples, kernel: str = "matern52", *, nugget: float = NUGGET,
    scale: float | None = None,
) -> SingleGP:  # fmt: skip
    """GP of `samples`, x scaled to about [0, 1].

    `nugget` is the median prior of noise beyond the samples' sds, relative to `scale`, which is
    the sd of y unless said otherwise.
    """
    n = len(samples.y)
    centre = float(np.mean(samples.y)) if n else 0.0
    scale = scale or spread(samples.y)
    y, sd = (samples.y - centre) / scale, samples.sd / scale
    data = TrainingData(samples.x, y[:, None], sd[:, None], np.full((n, 1), np.nan))
    mean, width = parse(kernel, samples.x.shape[1]).prior(AMPLITUDE, nugget, LENGTH, SPREAD)
    prior = Prior(np.zeros(1), np.full(1, BIAS_SD), np.zeros(1), mean[None, :], width[None, :])
    padded = pad(data, np.zeros(1, bool))
    start = laplace(kernel, padded, prior)
    counts = (256, 32) if n <= MANY else (32, 4)
    posterior = fit(padded, prior, *counts, kernel, 2, start)
    evidence = float(posterior.log_evidence[0]) - n * np.log(scale)
    return SingleGP(posterior, centre, scale, evidence)
