"""Recordings as screens look at them: visits of poses in order, hits by force level, their FRFs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from planner.dataset.level_columns import Column, column
from planner.errors import PlannerError, RefusedError
from planner.frf.estimator import estimate
from planner.frf.frf import Frf
from planner.recording.folder import read_recordings
from planner.recording.force_levels import levels, peak_n
from planner.recording.hits import hits_from
from planner.recording.read import read
from planner.recording.records import Hit, PoseRow
from planner.recording.screening import ScreeningLimits, screen

# Rate (1/s) of an exponential window that is laid over all records: decays that they cut off are
# then too small to matter, and FRFs hold at s = iω + rate.
LAID = 2.0


@dataclass(frozen=True, eq=False)
class Visit:
    """Hits at one pose without leaving it: q (dof,) in rad, `order` 0 to 1 through the campaign."""

    pose: str
    q: np.ndarray
    order: float
    hits: tuple[Hit, ...]


@dataclass(frozen=True, eq=False)
class Recorded:
    """Visits in the order of recording; a pose that was returned to has several.

    `window_rate_1_s` is that of an exponential window that all channels carry.
    """

    visits: tuple[Visit, ...]
    band_hz: tuple[float, float]
    window_rate_1_s: float = 0.0

    @property
    def q(self) -> np.ndarray:
        """(visits, dof) rad."""
        return np.array([visit.q for visit in self.visits])

    @cached_property
    def frfs(self) -> tuple[Frf, ...]:
        """Of each visit, all force levels together."""
        return tuple(self.frf(visit.hits) for visit in self.visits)

    @cached_property
    def _by_level(self) -> list[np.ndarray]:
        return levels(np.sort([peak_n(hit) for visit in self.visits for hit in visit.hits]))

    @cached_property
    def level_n(self) -> np.ndarray:
        """Peak forces (levels,) in N, weakest first: the same for all visits."""
        return np.array([float(np.exp(np.mean(np.log(group)))) for group in self._by_level])

    def level(self, hit: Hit) -> int:
        """Which of `level_n` a hit belongs to."""
        weakest = [group[0] for group in self._by_level[1:]]
        return int(np.searchsorted(weakest, peak_n(hit), side="right"))

    @cached_property
    def columns(self) -> tuple[tuple[Column, ...], ...]:
        """Of each visit: one column per hit axis and force level that was hit, weakest first."""
        return self.columns_at(LAID)

    def columns_at(self, laid_1_s: float) -> tuple[tuple[Column, ...], ...]:
        """As `columns`, with an exponential window of this rate (1/s) laid over the records."""
        length = max(len(hit.force_n) for visit in self.visits for hit in visit.hits)
        out = []
        for visit in self.visits:
            groups: dict[tuple[int, int], list[Hit]] = {}
            for hit in visit.hits:
                groups.setdefault((hit.axis_index, self.level(hit)), []).append(hit)
            found = [
                column(tuple(hits), *at, length, self.band_hz, laid_1_s, self.window_rate_1_s)
                for at, hits in sorted(groups.items())
            ]
            out.append(tuple(found))
        return tuple(out)

    def frf(self, hits: tuple[Hit, ...]) -> Frf:
        """FRF of some hits of a visit."""
        found = estimate(hits, self.band_hz, exponential_rate_1_s=LAID)
        return replace(found, exponential_rate_1_s=LAID + self.window_rate_1_s)


def read_visits(
    folder: Path, joint_names: tuple[str, ...], band_hz: tuple[float, float]
) -> Recorded:
    """Read a folder with recordings.csv; hits that cannot be used are left out.

    Hits are not compared with one another: that they disagree is what is looked for. Raises
    InputError where the table is wrong, RefusedError where no hit can be used.
    """
    runs: list[list[PoseRow]] = []
    for row in read_recordings(folder, joint_names).rows:
        if runs and runs[-1][-1].pose == row.pose:
            runs[-1].append(row)
        else:
            runs.append([row])
    limits = replace(ScreeningLimits(), band_hz=band_hz)
    last = max(len(runs) - 1, 1)
    visits = []
    for number, rows in enumerate(runs):
        q = np.deg2rad(np.mean([row.joints_deg for row in rows], axis=0))
        hits = tuple(hit for row in rows for hit in _usable(row, limits))
        if hits:
            visits.append(Visit(rows[0].pose, q, number / last, hits))
    if not visits:
        raise RefusedError(f"{folder}: none of its files holds a hit that can be used.")
    return Recorded(tuple(visits), band_hz)


def _usable(row: PoseRow, limits: ScreeningLimits) -> Sequence[Hit]:
    assert row.file is not None
    try:
        hits = hits_from(read(row.file), axis=row.hit)
    except PlannerError:
        return ()
    return [hit for hit in hits if not any(fault.refuse for fault in screen(hit, limits))]
