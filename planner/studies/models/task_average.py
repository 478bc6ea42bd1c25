"""Multi-task GP averaged over its hyperparameters: a Laplace mixture around the most probable."""

from dataclasses import dataclass

import numpy as np

from planner.studies.models import laplace
from planner.studies.models.multitask import MultiTaskGP, first_guess, log_density, prior_sds, solve


@dataclass(frozen=True, eq=False)
class MultiTaskAverage:
    """Fits that differ in their hyperparameters, of equal weight."""

    models: tuple[MultiTaskGP, ...]

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, t) of the noise-free outputs at x (q, d)."""
        found = [model.predict(x) for model in self.models]
        means, sds = (np.array([f[i] for f in found]) for i in (0, 1))
        return means.mean(axis=0), np.sqrt(np.mean(sds**2, axis=0) + np.var(means, axis=0))

    @property
    def correlation(self) -> np.ndarray:
        """Mean correlation (t, t) of the outputs."""
        return np.mean([model.correlation for model in self.models], axis=0)


def average_tasks(fitted: MultiTaskGP, count: int = laplace.COUNT) -> MultiTaskAverage:
    """Laplace mixture over all hyperparameters: t²/2 of L, t of the noise, the kernel's."""
    tasks, start = fitted.tasks, first_guess(fitted.tasks)
    middle, width = start.flat(), prior_sds(start)

    def slope(z: np.ndarray) -> np.ndarray:
        return z - width * log_density(tasks, start.like(middle + width * z))[1]

    peak = (fitted.hyperparameters.flat() - middle) / width
    points, _ = laplace.draws(slope, peak, count)
    drawn = [start.like(middle + width * z) for z in points]
    return MultiTaskAverage(
        tuple(MultiTaskGP(tasks, h, solve(tasks, h), fitted.centre, fitted.scale) for h in drawn)
    )
