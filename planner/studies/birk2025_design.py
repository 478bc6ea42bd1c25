"""Which poses determine a simulation's parameters: D-optimal points, one after the other.

With covariance Σ of the parameters' logarithms and Fisher information F of the hits at a pose, the
next point is that of the largest ½ log det(I + Lᵀ F L), Σ = L Lᵀ (Fedorov 1972), at the stated
parameters: before anything is measured, which is when it is asked.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.design.parameter_sensitivity import FrfNoise, OpenParameters
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Priors, parametrise
from planner.fit.result import TOLD
from planner.frf.frf import Frf


@dataclass(frozen=True, eq=False)
class Design:
    """Points (k,), how many parameters they determine, and FRAC in % at all others.

    FRAC is NaN where nothing was identified from them.
    """

    name: str
    rows: np.ndarray
    determined: int
    frac: float


@dataclass(frozen=True, eq=False)
class Informative:
    """What hits at n poses would tell of p parameters' logarithms.

    `covariance` (p, p) before, `information` (n, 3, p, p) of a hit along each axis.
    """

    covariance: np.ndarray
    information: np.ndarray

    @classmethod
    def of(
        cls, simulation: Simulation, priors: Priors, frfs: Sequence[Frf], q: np.ndarray,
        misfit: float, band_hz: tuple[float, float],
    ) -> "Informative":  # fmt: skip
        """At poses q (n, dof) in rad, with the noise of these FRFs and a misfit as found."""
        p = parametrise(simulation, priors)
        covariance = np.diag([parameter.log_sd**2 for parameter in p.parameters])
        noise = FrfNoise.of(tuple(frfs), band_hz, misfit)
        open_ = OpenParameters(simulation, p, covariance, noise, band_hz)
        return cls(covariance, open_.information(q))

    def best(self, count: int) -> np.ndarray:
        """Rows (count,), the most informative first, each hit along all axes."""
        covariance, told = self.covariance, self.information.sum(axis=1)
        chosen: list[int] = []
        for _ in range(count):
            root = np.linalg.cholesky(covariance)
            gained = np.eye(len(root)) + root.T @ told @ root
            gain = np.linalg.slogdet(gained)[1]
            gain[chosen] = -np.inf
            chosen.append(int(np.argmax(gain)))
            covariance = root @ np.linalg.inv(gained[chosen[-1]]) @ root.T
            covariance = (covariance + covariance.T) / 2
        return np.array(chosen)

    def determined(self, rows: np.ndarray, axes: Sequence[int] = (0, 1, 2)) -> int:
        """How many parameters hits along `axes` determine: sd less than half of before."""
        told = self.information[rows][:, list(axes)].sum(axis=(0, 1))
        after = np.linalg.inv(np.linalg.inv(self.covariance) + told)
        return int(np.sum(np.sqrt(np.diag(after) / np.diag(self.covariance)) < TOLD))
