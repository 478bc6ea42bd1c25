"""AR1 averaged over how plain the discrepancy of a simulation is, output by output.

Where values scatter, a discrepancy that is free to depend on the pose, and a slope that is free,
take some of the scatter for themselves. A simulation that is off by an offset alone needs
neither. Samples of the simpler models stand beside those of the free one, by their evidence.
"""

from dataclasses import replace

import numpy as np

from planner.inference.log_space import log_sum, shares
from planner.surrogate.ar1 import AR1, OutputPrior, fit_ar1
from planner.surrogate.training_data import TrainingData

GENTLE_SLOPE_SD = 0.05  # of ρ': a simulation of the same robot; chosen on generated cells
NO_DISCREPANCY = 1e-9  # amplitude, in the outputs' own unit
PLAIN_SAMPLES = 64  # of a nugget alone
GOLDEN_RATIO = (5**0.5 - 1) / 2  # multiples of it, less their integers, fill [0, 1) evenly


def fit_plain_or_free(
    data: TrainingData,
    with_low: tuple[OutputPrior, ...],
    without_low: tuple[OutputPrior, ...],
    centre: np.ndarray,
    samples: int = 256,
    kept: int = 32,
) -> AR1:
    """Fit m outputs; arguments as of `fit_ar1`. Outputs without simulation are GPs as ever."""
    free = fit_ar1(data, with_low, without_low, centre, samples, kept)
    asked = free.uses_low & free.posterior.mask.any(axis=1)
    if not asked.any():
        return free
    plain = tuple(map(_plain, with_low))
    models = [free, fit_ar1(data, plain, without_low, centre, PLAIN_SAMPLES, kept, "bias")]
    if max(prior.slope_sd for prior in with_low) > GENTLE_SLOPE_SD:
        gentle = tuple(replace(p, slope_sd=min(p.slope_sd, GENTLE_SLOPE_SD)) for p in with_low)
        models.append(fit_ar1(data, gentle, without_low, centre, samples, kept))
    return _averaged(models, asked)


def _plain(prior: OutputPrior) -> OutputPrior:
    nugget_spread = prior.spread if prior.nugget_spread is None else prior.nugget_spread
    return replace(
        prior, slope_sd=0.0, amplitude=NO_DISCREPANCY, spread=0.0, nugget_spread=nugget_spread
    )


def _averaged(models: list[AR1], asked: np.ndarray) -> AR1:
    """Samples of all models, of each as many as its weight says; of the first where not `asked`."""
    posteriors = [model.posterior for model in models]
    first = posteriors[0]
    m, kept, size = first.theta.shape
    evidence = np.array([p.log_evidence for p in posteriors])
    evidence[1:, ~asked] = -np.inf
    edges = np.cumsum(shares(evidence, axis=0), axis=0)[:-1]  # (models − 1, m)
    # Samples stand in an order; those that stay of each model are spread over it.
    place = (np.argsort(np.argsort((np.arange(kept) * GOLDEN_RATIO) % 1.0)) + 0.5) / kept
    chosen = np.sum(place[None, None, :] > edges[:, :, None], axis=0)  # (m, kept)

    def picked(arrays: list[np.ndarray]) -> np.ndarray:
        shape = m, kept, *[1] * (arrays[0].ndim - 2)
        return np.choose(chosen.reshape(shape), arrays)

    posterior = replace(
        first,
        # Length scales of no discrepancy mean nothing.
        theta=picked(
            [np.pad(p.theta, [(0, 0), (0, 0), (0, size - p.theta.shape[2])]) for p in posteriors]
        ),
        slope_sd=picked([p.slope_sd for p in posteriors]),
        # Each is believed as much as a GP that ignores the simulation, with which this is compared.
        log_evidence=log_sum(evidence, axis=0),
        jitter=max(p.jitter for p in posteriors),
    )
    return replace(models[0], posterior=posterior)
