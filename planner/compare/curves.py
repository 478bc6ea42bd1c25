"""Scores of predictions; learning curves of strategies over seeds, and how they differ."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from planner.compare.tasks import Run
from planner.frf.metrics import mean_known

Z_95 = 1.959964  # two-sided 95 % of a normal distribution
GOAL_PERCENT = 1.0
BOOTSTRAP_RESAMPLES = 2000  # of the seeds
BASELINE = "maximin_lhs"


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


@dataclass(frozen=True, eq=False)
class Curves:
    """One strategy's runs (s) by number of measurements n (t,): arrays (s, t).

    `minutes` are robot time: travel, settling and hits.
    """

    seeds: tuple[int, ...]
    n: np.ndarray
    frequency_rmse_percent: np.ndarray
    r2: np.ndarray
    coverage95: np.ndarray
    minutes: np.ndarray
    wall_seconds: np.ndarray  # (s,)
    process_seconds: np.ndarray  # (s,)

    @classmethod
    def of(cls, runs: Sequence[Run]) -> "Curves":
        """Of runs with the same initial poses and budget, one at least."""
        runs = sorted(runs, key=lambda run: run.seed)
        names = list(cls.__dataclass_fields__)[2:]
        columns = (np.array([getattr(run, name) for run in runs], dtype=float) for name in names)
        return cls(tuple(run.seed for run in runs), np.array(runs[0].n), *columns)

    @property
    def to_goal(self) -> int | None:
        """Fewest measurements with a median RMSE of at most 1 %; None: not within the budget."""
        first = self._first_at_goal
        return None if first is None else int(self.n[first])

    @property
    def minutes_to_goal(self) -> float | None:
        """Median minutes of robot time until then; None: not within the budget."""
        first = self._first_at_goal
        return None if first is None else float(np.median(self.minutes[:, first]))

    @property
    def _first_at_goal(self) -> int | None:
        reached = np.flatnonzero(np.median(self.frequency_rmse_percent, axis=0) <= GOAL_PERCENT)
        return int(reached[0]) if reached.size else None

    @property
    def each_to_goal(self) -> np.ndarray:
        """(s,) measurements of each run to 1 %; one more than the budget where it did not."""
        reached = self.frequency_rmse_percent <= GOAL_PERCENT
        first = np.where(reached.any(axis=1), reached.argmax(axis=1), len(self.n))
        return np.append(self.n, self.n[-1] + 1)[first]

    def only(self, seeds: Sequence[int]) -> "Curves":
        """The runs of some seeds."""
        rows = [self.seeds.index(seed) for seed in seeds]
        columns = [c[rows] for c in list(vars(self).values())[2:]]
        return Curves(tuple(seeds), self.n, *columns)


def paired(strategy: Curves, baseline: Curves) -> dict[str, Any] | None:
    """A strategy less the baseline, seed by seed; None if they share none; 95 % intervals.

    "seeds" says how many (initial poses) both have; "difference_percent" (t,) is the median
    difference of the RMSE in percentage points, its interval (t, 2) a bootstrap's over seeds;
    "measurements_to_one_percent" is the mean difference, where a run that did not get there counts
    as one more than the budget.
    """
    shared = [seed for seed in strategy.seeds if seed in baseline.seeds]
    if not shared:
        return None
    a, b = strategy.only(shared), baseline.only(shared)
    apart = a.frequency_rmse_percent - b.frequency_rmse_percent
    saved = (a.each_to_goal - b.each_to_goal).astype(float)
    picks = np.random.default_rng(0).integers(len(shared), size=(BOOTSTRAP_RESAMPLES, len(shared)))
    interval = np.percentile(np.median(apart[picks], axis=1), (2.5, 97.5), axis=0).T
    return {
        "seeds": len(shared),
        "difference_percent": np.median(apart, axis=0),
        "difference_percent_interval95": interval,
        "measurements_to_one_percent": float(saved.mean()),
        "measurements_to_one_percent_interval95": np.percentile(
            np.mean(saved[picks], axis=1), (2.5, 97.5)
        ),
    }


def baseline_of(strategies: Sequence[str]) -> str:
    """The strategy that the others are compared with: maximin LHS, or the first one named."""
    return BASELINE if BASELINE in strategies else strategies[0]


def medians(curve: Curves) -> dict[str, Any]:
    """Over runs, on poses not used, after "n" (t,) measurements; quartiles (2, t).

    "minutes" (t,) of robot time; the seconds are of all runs together.
    """
    rmse = curve.frequency_rmse_percent
    low, middle, high = np.percentile(rmse, (25, 50, 75), axis=0)
    return {
        "n": curve.n,
        "frequency_rmse_percent": middle,
        "frequency_rmse_percent_quartiles": np.array([low, high]),
        "frequency_rmse_percent_worst": rmse.max(axis=0),
        "r2": np.median(curve.r2, axis=0),
        "coverage95": np.median(curve.coverage95, axis=0),
        "coverage95_mean": np.mean(curve.coverage95, axis=0),
        "minutes": np.median(curve.minutes, axis=0),
        "wall_seconds": float(curve.wall_seconds.sum()),
        "process_seconds": float(curve.process_seconds.sum()),
        "runs": len(curve.seeds),
    }
