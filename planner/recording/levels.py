"""How hard the hits were: peaks and force levels."""

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage

from planner.recording.types import Hit

# Hits whose peaks differ by less than this factor are of one level: nobody hits alike twice.
SAME_LEVEL = 1.8


def peak_n(hit: Hit) -> float:
    """Largest force of a hit over its offset, in N."""
    return float(np.max(np.abs(hit.force_n - np.median(hit.force_n))))


def by_level(hits: tuple[Hit, ...]) -> tuple[tuple[Hit, ...], ...]:
    """The hits by strength, weakest level first; a gap of SAME_LEVEL between peaks separates."""
    groups: list[list[Hit]] = []
    for hit in sorted(hits, key=peak_n):
        if groups and peak_n(hit) < SAME_LEVEL * peak_n(groups[-1][-1]):
            groups[-1].append(hit)
        else:
            groups.append([hit])
    return tuple(tuple(group) for group in groups)


def levels(peaks_n: np.ndarray) -> list[np.ndarray]:
    """Peaks (n,) in N, sorted, by level: weakest first.

    Levels are told by the gaps between them. Where forces in between fill these, so that peaks
    reach farther than a level does, they are parted where they are sparse (Ward's criterion).
    """
    starts = np.flatnonzero(np.diff(np.log(peaks_n)) > np.log(SAME_LEVEL) / 3) + 1
    groups = np.split(peaks_n, starts)
    merged = [groups[0]]
    for group in groups[1:]:
        if group[-1] < SAME_LEVEL * merged[-1][0]:
            merged[-1] = np.append(merged[-1], group)
        else:
            merged.append(group)
    return [part for group in merged for part in _parted(group)]


def _parted(peaks_n: np.ndarray) -> list[np.ndarray]:
    count = round(float(np.log(peaks_n[-1] / peaks_n[0]) / np.log(SAME_LEVEL)))
    if count < 2:
        return [peaks_n]
    which = fcluster(linkage(np.log(peaks_n)[:, None], "ward"), count, "maxclust")
    return np.split(peaks_n, np.flatnonzero(np.diff(which)) + 1)
