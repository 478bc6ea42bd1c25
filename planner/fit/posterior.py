"""What is believed of a robot after a fit: its simulation, its FRFs anywhere, and how unsure."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.dynamics.simulation import Simulation
from planner.fit.data import FrfData
from planner.fit.misfit import Misfit
from planner.fit.search import Found
from planner.fit.structure import Structure, exported
from planner.identification.measured_frfs import Measured
from planner.inference.least_squares import inverse


@dataclass(frozen=True, eq=False)
class Posterior:
    """A structure at x with the covariance of x; `size` is that of the discrepancy."""

    structure: Structure
    x: np.ndarray
    covariance: np.ndarray
    size: float
    found: Found

    @classmethod
    def of(cls, found: Found) -> "Posterior":
        """After a fit."""
        covariance = inverse(found.at.normal + found.structure.precision)
        assert found.misfit.rho is not None
        return cls(found.structure, found.at.x, covariance, found.misfit.rho, found)

    @cached_property
    def simulation(self) -> Simulation:
        """The robot with its effects at x."""
        return exported(self.structure, self.x)[0]

    @cached_property
    def root(self) -> np.ndarray:
        """R with R Rᵀ the covariance, of all but the chain's numbers."""
        own = self.structure.chain.start
        covariance = self.covariance[:own, :own]
        unit = np.sqrt(np.diagonal(covariance))
        values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
        return unit[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))

    def response(self, q: np.ndarray, frequency_hz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """FRFs (n, 3, 3, F) of the tool in m/s²/N at q (n, dof) in rad, and their sds."""
        means, sds = [], []
        for row in np.atleast_2d(q):
            misfit = Misfit(self.structure, self._at(row[None], frequency_hz), self.tolerances)
            motion = misfit.motion(self.x, None)
            slopes, _ = misfit.slopes(motion, self.x)
            moved = self.root.T @ slopes[0].reshape(slopes.shape[1], -1)
            sd = np.sqrt(np.sum(moved.real**2 + moved.imag**2, axis=0))
            means.append(motion.accelerance[0])
            sds.append(sd.reshape(means[-1].shape))
        return np.array(means), np.array(sds)

    @property
    def tolerances(self):
        """Of hits, chain and readback."""
        return self.found.misfit.tolerances

    def _at(self, q: np.ndarray, frequency_hz: np.ndarray) -> FrfData:
        elastic = self._carried
        lines = np.atleast_2d(frequency_hz)
        shape = (len(q), 3, 3, lines.shape[1])
        ones = np.ones(shape)
        measured = Measured(
            lines, 2j * np.pi * lines, ones.astype(complex), ones, np.full(len(q), np.inf)
        )
        return FrfData(q, measured, elastic.matrices(q), elastic.body_jacobians(q))

    @cached_property
    def _carried(self):
        return self.structure.prior.carried

    def scale_sd(self) -> float:
        """Relative sd of the common scale of all FRFs, which only gains and masses hold."""
        return 0.0
