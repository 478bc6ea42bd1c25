"""Files by pose and by visit: where a recording was made, and which of them belong together."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import NamedTuple

import numpy as np

from planner.dataset.measure import MeasuredPose
from planner.dataset.screened_files import Source
from planner.recording.records import Hit


@dataclass(frozen=True, eq=False)
class Visit:
    """Hits at one pose without leaving it: q (dof,) in rad, `order` 0 to 1 through the campaign.

    Its hits are good by themselves. Some may disagree with their repeats: that is what screens
    look for.
    """

    pose: str
    q: np.ndarray
    order: float
    hits: tuple[Hit, ...]


class Recording(NamedTuple):
    """One file: the pose at which it was recorded, its readback q (dof,) in rad, where it lies."""

    pose: str
    q: np.ndarray
    source: Source


class Stay(NamedTuple):
    """A visit before its files are read: which entry, which of its files, and as in `Visit`."""

    entry: int
    files: tuple[int, ...]
    q: np.ndarray
    order: float


@dataclass(frozen=True, eq=False)
class PoseEntry:
    """What has an FRF of its own: as a rule a pose with all its visits; q (dof,) in rad."""

    pose: str
    q: np.ndarray
    measured: MeasuredPose


def stays_of(recordings: Sequence[Recording]) -> tuple[Stay, ...]:
    """Neighbouring recordings of one pose are a visit."""
    numbers: dict[str, int] = {}
    files: dict[str, int] = {}
    runs = [list(run) for _, run in groupby(recordings, key=lambda recording: recording.pose)]
    found = []
    for place, run in enumerate(runs):
        pose = run[0].pose
        first = files.get(pose, 0)
        files[pose] = first + len(run)
        entry = numbers.setdefault(pose, len(numbers))
        q = np.mean([recording.q for recording in run], axis=0)
        order = place / max(len(runs) - 1, 1)
        found.append(Stay(entry, tuple(range(first, files[pose])), q, order))
    return tuple(found)
