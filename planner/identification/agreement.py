"""How well a simulation, identified or not, agrees with FRFs, and where it does not."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.dynamics.gradient import response
from planner.dynamics.simulation import Simulation
from planner.frf import metrics
from planner.frf.frf import Frf
from planner.identification.measured_frfs import Measured, common_band, stack
from planner.identification.truncated_decay import cut_off

MODEL_ERROR = 0.003  # relative sd of all that no simulation follows: calibration, angles
MOST_LINES = 512  # a pose


@dataclass(frozen=True)
class Similarity:
    """Global FRAC and Frobenius similarity, means over the direct FRFs (`planner.frf.metrics`)."""

    frac: float
    frobenius: float


@dataclass(frozen=True, eq=False)
class Residuals:
    """Simulated minus measured FRFs in sds of the noise: complex (n, 3, 3, F), NaN where unused.

    Real and imaginary parts have variance 1 where the simulation is right. Lines (n, F) in Hz are
    each pose's own.
    """

    frequency_hz: np.ndarray
    values: np.ndarray

    @property
    def by_pose(self) -> np.ndarray:
        """(n,) misfits: mean square of the real values, 1 at the noise."""
        flat = self.values.reshape(len(self.values), -1)
        used = np.isfinite(flat)
        square = np.where(used, np.abs(np.where(used, flat, 0)) ** 2, 0.0)
        return np.sum(square, axis=1) / np.maximum(2 * np.sum(used, axis=1), 1)


def fit_similarity(
    simulation: Simulation,
    frfs: Sequence[Frf],
    q: np.ndarray,
    band_hz: tuple[float, float] | None = None,
    lines: int = MOST_LINES,
) -> Similarity:
    """Global FRAC and Frobenius similarity of a simulation to FRFs at q (n, dof) in rad.

    On at most so many `lines` a pose.
    """
    measured = _stacked(simulation, frfs, band_hz, lines)
    return similarity_of(measured, _simulated(simulation, measured, q))


def similarity_of(measured: Measured, h: np.ndarray) -> Similarity:
    """The same of FRFs h (n, 3, 3, F) in m/s²/N on the measured lines."""
    parts = []
    given = np.where(measured.used, measured.accelerance, np.nan)
    for i, used in enumerate(measured.used):
        lines = used.any(axis=(0, 1))
        parts.append(metrics.agreement(given[i : i + 1, ..., lines], h[i : i + 1, ..., lines]))
    whole = metrics.stack(parts)
    return Similarity(metrics.direct_mean(whole.global_frac), metrics.direct_mean(whole.frobenius))


def residuals(
    simulation: Simulation,
    frfs: Sequence[Frf],
    q: np.ndarray,
    band_hz: tuple[float, float] | None = None,
) -> Residuals:
    """What a simulation leaves unexplained of FRFs at q (n, dof) in rad, in robot.toml's band."""
    measured = _stacked(simulation, frfs, band_hz)
    return _residuals_of(measured, _simulated(simulation, measured, q))


def _residuals_of(measured: Measured, h: np.ndarray) -> Residuals:
    difference = h - measured.accelerance
    values = np.where(measured.used, np.sqrt(2) * difference / measured.sd, np.nan)
    return Residuals(measured.frequency_hz, values)


def _stacked(
    simulation: Simulation,
    frfs: Sequence[Frf],
    band_hz: tuple[float, float] | None,
    lines: int = MOST_LINES,
) -> Measured:
    band = common_band(frfs, band_hz or simulation.robot.config.band_hz)
    return stack(frfs, band, lines, MODEL_ERROR)


def _simulated(simulation: Simulation, measured: Measured, q: np.ndarray) -> np.ndarray:
    """(n, r, c, F), cut off at the records' ends as the measured ones are."""
    matrices = measured.loaded(simulation.elastic.matrices(q, layout=measured.layout), simulation)
    h = response(matrices, simulation.elasticity, measured.s)
    if np.isfinite(measured.tail_s).any():
        h -= cut_off(simulation.solved(matrices), measured.s, measured.tail_s)
    return h
