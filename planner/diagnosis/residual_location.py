"""Where the refitted simulation still differs from what was recorded."""

from dataclasses import dataclass

import numpy as np

from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.linear.mismatch import residuals
from planner.diagnosis.linear.problem import FINE, Problem
from planner.diagnosis.thresholds import RESIDUAL_CLEARLY, RESIDUAL_SHARE

BANDS = 12


@dataclass(frozen=True, eq=False)
class Where:
    """Mean square residuals: by band (k,), pose (n,), response and hit (3, 3).

    1 is noise and what just does not matter ([diagnose] matters_percent) together; `edges_hz`
    (k + 1,) are the bands'.
    """

    edges_hz: np.ndarray
    by_band: np.ndarray
    by_pose: np.ndarray
    by_direction: np.ndarray

    def bands_hz(self) -> list[list[float]]:
        """Bands that differ, neighbours joined."""
        out: list[list[float]] = []
        for k in np.flatnonzero(_stands_out(self.by_band)):
            low, high = float(self.edges_hz[k]), float(self.edges_hz[k + 1])
            if out and out[-1][1] == low:
                out[-1][1] = high
            else:
                out.append([low, high])
        return out

    def poses(self) -> list[int]:
        """Indices of the poses that differ."""
        return np.flatnonzero(_stands_out(self.by_pose)).tolist()

    def directions(self) -> list[str]:
        """Directions of response in which they differ."""
        return ["xyz"[i] for i in np.flatnonzero(_stands_out(self.by_direction.mean(axis=1)))]


def where(problem: Problem, found: Fit) -> Where:
    """Residuals of a fit on the lines that it was fitted to, misses of hits and chain taken out."""
    misfit = problem.misfit(found.effect, FINE)
    measured = misfit.measured
    _, left = residuals(misfit, found.x)
    square = np.where(measured.used, np.abs(left) ** 2 / 2, np.nan)
    edges = np.linspace(*problem.band_hz, BANDS + 1)
    place = np.clip(np.searchsorted(edges, measured.frequency_hz, "right") - 1, 0, BANDS - 1)
    bands = [_mean(np.where((place == k)[:, None, None], square, np.nan)) for k in range(BANDS)]
    poses = [_mean(one) for one in square]
    directions = [[_mean(square[:, i::3, j::3]) for j in range(3)] for i in range(3)]
    return Where(edges, np.array(bands), np.array(poses), np.array(directions))


def _mean(values: np.ndarray) -> float:
    known = np.isfinite(values)
    return float(values[known].mean()) if known.any() else 0.0


def _stands_out(values: np.ndarray) -> np.ndarray:
    return (values > RESIDUAL_CLEARLY) & (values > RESIDUAL_SHARE * values.max())
