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
    """The hits by strength, weakest level first; see `levels`."""
    ordered = sorted(hits, key=peak_n)
    groups = levels(np.array([peak_n(hit) for hit in ordered]))
    ends = np.cumsum([len(group) for group in groups]).tolist()
    return tuple(tuple(ordered[end - len(g) : end]) for g, end in zip(groups, ends, strict=True))


def levels(peaks_n: np.ndarray) -> list[np.ndarray]:
    """Peaks (n,) in N, sorted, by level: weakest first.

    Clusters in logarithms by average linkage: means of two levels differ by SAME_LEVEL or more,
    and forces in between join the nearer one.
    """
    if len(peaks_n) < 2:
        return [peaks_n]
    tree = linkage(np.log(peaks_n)[:, None], "average")
    which = fcluster(tree, np.log(SAME_LEVEL), "distance")
    return np.split(peaks_n, np.flatnonzero(np.diff(which)) + 1)
