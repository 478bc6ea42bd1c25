"""A prediction as a mixture of Gaussians, one per model and hyperparameter sample.

Mean and sd alone make it a Gaussian, which it is not where the models disagree: then its tails are
heavier and its middle narrower.
"""

from dataclasses import dataclass

import numpy as np

BISECTIONS = 60  # 2⁻⁶⁰ of the first interval: all digits of a double


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

    def below(self, y: np.ndarray) -> np.ndarray:
        """Probability (q,) of a value below y (q,)."""
        from scipy.special import ndtr  # 0.1 s, which predictions do not need

        sds = np.maximum(self.sds, 1e-300)
        return self.weights @ ndtr((y - self.means) / sds)

    def quantile(self, probability: float) -> np.ndarray:
        """The value (q,) below which `probability` lies."""
        from scipy.special import ndtri

        reach = abs(ndtri(probability)) + 8
        low, high = (np.min(self.means - reach * self.sds, axis=0),
                     np.max(self.means + reach * self.sds, axis=0))  # fmt: skip
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            short = self.below(middle) < probability
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        return (low + high) / 2

    def scaled(self, centre: float, scale: float) -> "Predictive":
        """Of centre + scale·y."""
        return Predictive(self.weights, centre + scale * self.means, abs(scale) * self.sds)

    def widened(self, sd: np.ndarray) -> "Predictive":
        """With independent noise of sd (k, q) or (q,) added."""
        return Predictive(self.weights, self.means, np.hypot(self.sds, sd))
