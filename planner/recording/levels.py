"""How hard the hits were: peaks and force levels."""

import numpy as np

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
