"""AR1s (or GPs) that differ in their kernel, averaged by evidence, output by output.

Damping of one robot is the same everywhere, of another a smooth function of the pose; Busch et
al. 2022 (section 3.2) choose its kernel by hand.
"""

from dataclasses import dataclass

import numpy as np

from planner.surrogate.ar1 import AR1, OutputPrior, fit_ar1
from planner.surrogate.gp import Posterior
from planner.surrogate.training_data import TrainingData

NEGLIGIBLE_WEIGHT = 1e-3  # below which a kernel is not evaluated for an output


@dataclass(frozen=True, eq=False)
class KernelAverage:
    """Fits by kernel; weights (kernel, m), whose columns sum to one."""

    kernels: tuple[str, ...]
    models: tuple[AR1, ...]
    weights: np.ndarray

    @property
    def counted(self) -> list[int]:
        """Which of the models are not negligible for every output."""
        return np.flatnonzero(self.weights.max(axis=1) > NEGLIGIBLE_WEIGHT).tolist()

    @property
    def posteriors(self) -> tuple[Posterior, ...]:
        """Of the models that count."""
        return tuple(self.models[i].posterior for i in self.counted)

    @property
    def log_evidence(self) -> np.ndarray:
        """(m,) of all kernels together."""
        each = np.array([m.posterior.log_evidence for m in self.models])
        return np.logaddexp.reduce(each, axis=0) - np.log(len(self.models))

    def predict(self, x: np.ndarray, low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, m) at x (q, d), simulation low (q, m) (NaN: unknown there)."""
        counted = np.where(self.weights > NEGLIGIBLE_WEIGHT, self.weights, 0.0)
        shape = len(self.models), len(x), self.weights.shape[1]
        means, sds = np.zeros(shape), np.zeros(shape)
        for model, weight, mean, sd in zip(self.models, counted, means, sds, strict=True):
            some = np.flatnonzero(weight)
            if len(some):
                mean[:, some], sd[:, some] = model.predict(x, low, some)
        w = counted[:, None, :] / counted.sum(axis=0)
        mean = np.sum(w * means, axis=0)
        return mean, np.sqrt(np.sum(w * (sds**2 + (means - mean) ** 2), axis=0))


def either(first: KernelAverage, second: KernelAverage) -> KernelAverage:
    """Both, by evidence: equally likely before the data, which must be the same for both."""
    models = (*first.models, *second.models)
    return KernelAverage((*first.kernels, *second.kernels), models, _by_evidence(models))


def fit_shapes(
    data: TrainingData,
    with_low: tuple[OutputPrior, ...],
    without_low: tuple[OutputPrior, ...],
    centre: np.ndarray,
    kernels: tuple[str, ...],
    samples: int = 64,
    kept: int = 16,
) -> KernelAverage:
    """Fit m outputs with every kernel; the other arguments as of `fit_ar1`."""
    models = tuple(
        fit_ar1(data, with_low, without_low, centre, samples, kept, kernel) for kernel in kernels
    )
    return KernelAverage(kernels, models, _by_evidence(models))


def _by_evidence(models: tuple[AR1, ...]) -> np.ndarray:
    evidence = np.array([m.posterior.log_evidence for m in models])
    weights = np.exp(evidence - evidence.max(axis=0))
    return weights / weights.sum(axis=0)
