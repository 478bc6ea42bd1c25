"""Mixture of models of one output, each weighted by the probability of the data under it.

A wrong simulation makes AR1 worse than a GP without it; the data say so, and the mixture follows
them (Bayesian model averaging, Hoeting et al. 1999).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm

from planner.errors import InputError
from planner.surrogate.models.averaged import AveragedModel
from planner.surrogate.predictive import Predictive

NEGLIGIBLE = 1e-4  # weight below which a model is not asked


@dataclass(frozen=True, eq=False)
class Mixture:
    """Models by name and their weights, which sum to one."""

    models: "Mapping[str, AveragedModel | Mixture]"
    weights: Mapping[str, float]
    log_evidence: float

    def predictive(self, x: np.ndarray) -> Predictive:
        """The output at x (q, d), one Gaussian per model and sample of its hyperparameters."""
        asked = [name for name, w in self.weights.items() if w > NEGLIGIBLE]
        w = np.array([self.weights[name] for name in asked])
        return together([self.models[name].predictive(x) for name in asked], w / w.sum())

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Median and sd (q,) of the noise-free output at x (q, d)."""
        mixture = self.predictive(x)
        return mixture.median, mixture.sd


def mix(models: Mapping[str, AveragedModel], prior: Mapping[str, float] | None = None) -> Mixture:
    """Mixture with prior weights (default: all alike); log-evidences must be of the same data."""
    if not models:
        raise InputError("A mixture needs at least one model.")
    names = list(models)
    evidence = np.array([models[name].log_evidence for name in names])
    belief = np.array([1.0 if prior is None else prior.get(name, 0.0) for name in names])
    log_weight = evidence + np.log(np.maximum(belief / belief.sum(), 1e-300))
    top = float(np.max(log_weight))
    weight = np.exp(log_weight - top)
    total = float(weight.sum())
    return Mixture(
        dict(models),
        dict(zip(names, (weight / total).tolist(), strict=True)),
        top + float(np.log(total)),
    )


def together(parts: list[Predictive], weights: np.ndarray) -> Predictive:
    """The mixture of mixtures, in these proportions (sum to one)."""
    shares = [w * p.weights for w, p in zip(weights.tolist(), parts, strict=True)]
    return Predictive(
        np.concatenate(shares),
        np.concatenate([p.means for p in parts]),
        np.concatenate([p.sds for p in parts]),
    )


def log_density(found: Predictive, y: np.ndarray) -> np.ndarray:
    """log p(y) (q,) of values y (q,)."""
    each = norm.logpdf(y, found.means, found.sds)
    return np.asarray(logsumexp(each, axis=0, b=found.weights[:, None]))
