"""The natural frequencies' posterior as acquisitions see it, with fantasies of poses to come."""

from dataclasses import dataclass, replace

import numpy as np

from planner.fusion.gp import Posterior
from planner.fusion.surrogate import Surrogate

MEASUREMENT_SD = 1e-3  # relative sd that EMA gives a frequency


@dataclass(frozen=True, eq=False)
class FrequencyOutputs:
    """Log-frequencies of k labels and the workspace points x (u, d), low (u, k) to be good at.

    `planned_x`, `planned_low` are poses already chosen and not measured yet: their effect on
    every covariance is exact, for it does not depend on what will be measured there.
    """

    posterior: Posterior
    x: np.ndarray
    low: np.ndarray
    weights: np.ndarray  # (k,)
    noise: np.ndarray  # (k,) variance of one measurement
    planned_x: np.ndarray
    planned_low: np.ndarray

    @classmethod
    def of(cls, surrogate: Surrogate, x: np.ndarray, low: np.ndarray) -> "FrequencyOutputs":
        """All labels, equally important, over the workspace points given."""
        k, posterior = surrogate.count, surrogate.primary.posterior
        noise = posterior.nugget_variance()[:k] + MEASUREMENT_SD**2
        none = np.zeros((0, x.shape[1])), np.zeros((0, k))
        return cls(posterior, x, low, np.full(k, 1 / k), noise, *none)

    @property
    def count(self) -> int:
        """Number of labels."""
        return len(self.weights)

    def planning(self, x: np.ndarray, low: np.ndarray) -> "FrequencyOutputs":
        """The same once a pose x (d,), low (k,) has been measured too."""
        return replace(
            self,
            planned_x=np.vstack([self.planned_x, x[None, :]]),
            planned_low=np.vstack([self.planned_low, low[None, :]]),
        )

    def covariance(
        self, k: int, xa: np.ndarray, la: np.ndarray, xb: np.ndarray, lb: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Posterior covariance (s, a, b) and variances (s, a), (s, b) of label k, per sample s."""
        cov, va, vb = self._measured(k, xa, la, xb, lb)
        if not len(self.planned_x):
            return cov, va, vb
        px, pl = self.planned_x, self.planned_low
        pp, _, _ = self._measured(k, px, pl, px, pl)
        pp = pp + self.noise[k] * np.eye(len(px))
        ap, _, _ = self._measured(k, xa, la, px, pl)
        bp, _, _ = self._measured(k, xb, lb, px, pl)
        root = np.linalg.cholesky(pp)
        wa = np.linalg.solve(root, np.swapaxes(ap, 1, 2))
        wb = np.linalg.solve(root, np.swapaxes(bp, 1, 2))
        cov = cov - np.swapaxes(wa, 1, 2) @ wb
        return cov, va - np.sum(wa**2, axis=1), vb - np.sum(wb**2, axis=1)

    def variance(self, k: int, x: np.ndarray, low: np.ndarray) -> np.ndarray:
        """Posterior variance (n,) of label k, averaged over the hyperparameters."""
        # One point on the other side: only the variances are wanted.
        _, variance, _ = self.covariance(k, x, low, self.x[:1], self.low[:1])
        return np.mean(variance, axis=0)

    def _measured(
        self, k: int, xa: np.ndarray, la: np.ndarray, xb: np.ndarray, lb: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.posterior.covariance(k, xa, la[:, k], xb, lb[:, k])
