"""A prediction as what it is: a mixture of Gaussians, one per model and hyperparameter sample.

Mean and sd alone make it a Gaussian, which it is not where the models disagree: then its tails are
heavier and its middle narrower.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp, ndtr, ndtri

HALVINGS = 60


@dataclass(frozen=True, eq=False)
class Predictive:
    """k Gaussians at each of q points: weights (k,) that sum to one, mean and sd (k, q)."""

    weights: np.ndarray
    means: np.ndarray
    sds: np.ndarray

    @property
    def mean(self) -> np.ndarray:
        """(q,)."""
        return self.weights @ self.means

    @property
    def median(self) -> np.ndarray:
        """(q,): nearer to the truth than the mean where a few components stray far."""
        return self.quantile(0.5)

    @property
    def sd(self) -> np.ndarray:
        """(q,)."""
        return np.sqrt(self.weights @ (self.sds**2 + (self.means - self.mean) ** 2))

    def log_density(self, y: np.ndarray, least_sd: float = 0.0) -> np.ndarray:
        """log p(y) (q,); no component counts as surer than `least_sd`."""
        sds = np.maximum(self.sds, least_sd)
        return np.asarray(
            logsumexp(_log_normal(y, self.means, sds), axis=0, b=self.weights[:, None])
        )

    def below(self, y: np.ndarray) -> np.ndarray:
        """Probability (q,) of a value below y (q,)."""
        sds = np.maximum(self.sds, 1e-300)
        return self.weights @ ndtr((y - self.means) / sds)

    def quantile(self, probability: float) -> np.ndarray:
        """The value (q,) below which `probability` lies."""
        reach = abs(ndtri(probability)) + 8
        low, high = (np.min(self.means - reach * self.sds, axis=0),
                     np.max(self.means + reach * self.sds, axis=0))  # fmt: skip
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            short = self.below(middle) < probability
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        return (low + high) / 2

    def interval(self, level: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Bounds (q,) of the central interval that holds `level` of the probability."""
        return self.quantile((1 - level) / 2), self.quantile((1 + level) / 2)

    def scaled(self, centre: float, scale: float) -> "Predictive":
        """Of centre + scale·y."""
        return Predictive(self.weights, centre + scale * self.means, abs(scale) * self.sds)

    def widened(self, sd: np.ndarray) -> "Predictive":
        """With independent noise of sd (k, q) or (q,) added."""
        return Predictive(self.weights, self.means, np.hypot(self.sds, sd))


def together(parts: list[Predictive], weights: np.ndarray) -> Predictive:
    """The mixture of mixtures, in these proportions (sum to one)."""
    shares = [w * p.weights for w, p in zip(weights.tolist(), parts, strict=True)]
    return Predictive(
        np.concatenate(shares),
        np.concatenate([p.means for p in parts]),
        np.concatenate([p.sds for p in parts]),
    )


def _log_normal(y: np.ndarray, mean: np.ndarray, sd: np.ndarray) -> np.ndarray:
    """Logarithm of the normal density; shapes broadcast."""
    return -0.5 * ((y - mean) / sd) ** 2 - np.log(sd) - 0.5 * np.log(2 * np.pi)
