"""How good predicted frequencies are at poses that were not used."""

from typing import NamedTuple

import numpy as np

from planner.frf.metrics import mean_known

Z_95 = 1.959964  # two-sided 95 % of a normal distribution


class Score(NamedTuple):
    """Relative RMSE in %, R² (mean over modes), share of measured values in 95 % intervals."""

    frequency_rmse_percent: float
    r2: float
    coverage95: float


def score(
    predicted_hz: np.ndarray, sd_hz: np.ndarray, measured_hz: np.ndarray, measured_sd: np.ndarray
) -> Score:
    """Score predictions of k frequencies at u poses.

    All arguments are (u, k) in Hz, the measured ones NaN where a mode was not found. Intervals
    contain the prediction's sd and the measurement's own.
    """
    known = np.isfinite(measured_hz)
    relative = np.where(known, predicted_hz / np.where(known, measured_hz, 1.0) - 1, np.nan)
    left = mean_known((predicted_hz - measured_hz) ** 2, axis=0)
    spread = mean_known((measured_hz - mean_known(measured_hz, axis=0)) ** 2, axis=0)
    varies = spread > 0
    r2 = 1 - np.divide(left, spread, out=np.full_like(left, np.nan), where=varies)
    sd = np.hypot(sd_hz, np.where(np.isfinite(measured_sd), measured_sd, 0.0))
    inside = np.where(known, np.abs(predicted_hz - measured_hz) <= Z_95 * sd, np.nan)
    return Score(
        float(100 * np.sqrt(mean_known(relative**2))),
        float(mean_known(r2)),
        float(mean_known(inside)),
    )
