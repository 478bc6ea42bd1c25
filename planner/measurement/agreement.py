"""How well a simulation, identified or not, agrees with FRFs."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.dynamics.gradient import response
from planner.dynamics.simulation import Simulation
from planner.frf import metrics
from planner.frf.frf import Frf
from planner.measurement.measured_frfs import Measured, common_band, cut_off, stack

MODEL_ERROR = 0.003  # relative sd of all that no simulation follows: calibration, angles
MOST_LINES = 512  # a pose


@dataclass(frozen=True)
class Similarity:
    """Global FRAC and Frobenius similarity over magnitudes, means over the direct FRFs.

    As of `planner.frf.metrics` (Birk et al. 2025): 1 where equal, NaN where there is no pose to
    compare at.
    """

    frac: float = math.nan
    frobenius: float = math.nan


NO_SIMILARITY = Similarity()


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
    band = common_band(frfs, band_hz or simulation.robot.config.band_hz)
    measured = stack(frfs, band, lines, MODEL_ERROR)
    there = simulation.elastic.matrices(q, layout=measured.layout)
    matrices = measured.loaded(there, simulation.robot)
    h = response(matrices, simulation.elasticity, measured.s)
    if np.isfinite(measured.tail_s).any():  # cut off at the records' ends as the measured ones are
        h -= cut_off(simulation.solved(matrices), measured.s, measured.tail_s)
    return similarity_of(measured, h)


def similarity_of(measured: Measured, h: np.ndarray) -> Similarity:
    """The same of FRFs h (n, 3, 3, F) in m/s²/N on the measured lines."""
    parts = []
    given = np.where(measured.used, measured.accelerance, np.nan)
    for i, used in enumerate(measured.used):
        lines = used.any(axis=(0, 1))
        parts.append(metrics.agreement(given[i : i + 1, ..., lines], h[i : i + 1, ..., lines]))
    whole = metrics.Agreement.joined(parts)
    return Similarity(metrics.direct_mean(whole.global_frac), metrics.direct_mean(whole.frobenius))
