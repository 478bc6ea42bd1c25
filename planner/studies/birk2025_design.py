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
from planner.frf.frf import Frf
from planner.identification.parameters import Priors, parametrise
from planner.identification.result import TOLD


@dataclass(frozen=True, eq=False)
class Design:
    """Points (k,), how many parameters they determine, and FRAC in % at all others."""

    name: str
    rows: np.ndarray
    determined: int
    frac: float


def best_points(
    simulation: Simulation, frfs: Sequence[Frf], q: np.ndarray, count: int, misfit: float,
    band_hz: tuple[float, float],
) -> np.ndarray:  # fmt: skip
    """Rows (count,) of q (n, dof) in rad, the most informative first."""
    covariance, information = _open(simulation, frfs, q, misfit, band_hz)
    chosen: list[int] = []
    for _ in range(count):
        root = np.linalg.cholesky(covariance)
        gained = np.eye(len(root)) + root.T @ information @ root
        gain = np.linalg.slogdet(gained)[1]
        gain[chosen] = -np.inf
        chosen.append(int(np.argmax(gain)))
        covariance = root @ np.linalg.inv(gained[chosen[-1]]) @ root.T
        covariance = (covariance + covariance.T) / 2
    return np.array(chosen)


def determined(
    simulation: Simulation, frfs: Sequence[Frf], q: np.ndarray, rows: np.ndarray, misfit: float,
    band_hz: tuple[float, float],
) -> int:  # fmt: skip
    """How many parameters hits at some poses determine: their sd is less than half of before."""
    covariance, information = _open(simulation, frfs, q, misfit, band_hz)
    after = np.linalg.inv(np.linalg.inv(covariance) + information[rows].sum(axis=0))
    return int(np.sum(np.sqrt(np.diag(after) / np.diag(covariance)) < TOLD))


def _open(
    simulation: Simulation, frfs: Sequence[Frf], q: np.ndarray, misfit: float,
    band_hz: tuple[float, float],
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Prior covariance (p, p) and information (n, p, p) of a hit along each axis."""
    p = parametrise(simulation, Priors())
    covariance = np.diag([parameter.log_sd**2 for parameter in p.parameters])
    noise = FrfNoise.of(tuple(frfs), band_hz, misfit)
    told = OpenParameters(simulation, p, covariance, noise, band_hz).information(q)
    return covariance, told.sum(axis=1)
