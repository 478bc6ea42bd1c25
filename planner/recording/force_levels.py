"""How hard the hits were: peaks and force levels."""

from collections.abc import Sequence

import numpy as np

from planner.recording.records import Hit

# Levels differ by this factor or more: nobody hits alike twice.
SAME_LEVEL = 1.8
FAR_BELOW = 0.1  # of the median of other hits; chosen, for no hand misses its force by so much


def pulse_s(hit: Hit) -> float:
    """Impulse of a hit over its peak: about the width of its pulse at half its height."""
    pulse = hit.pulse
    force = hit.force_n[pulse.first : pulse.end] - pulse.offset_n
    return abs(float(np.sum(force))) / (hit.sampling_rate_hz * pulse.peak_n)


def far_below(hit: Hit, others: Sequence[Hit]) -> float | None:
    """The median peak (N) of other hits along its axis, where a hit is far below it; else None.

    A level that is there more than once is meant.
    """
    peak = hit.pulse.peak_n
    peaks = [one.pulse.peak_n for one in others if one.axis_index == hit.axis_index]
    meant = any(max(p, peak) < SAME_LEVEL * min(p, peak) for p in peaks)
    usual = float(np.median(peaks)) if peaks else 0.0
    return None if meant or peak >= FAR_BELOW * usual else usual


def by_level(hits: tuple[Hit, ...]) -> tuple[tuple[Hit, ...], ...]:
    """The hits by strength, weakest level first; a gap of SAME_LEVEL between peaks separates."""
    ordered = sorted(hits, key=lambda hit: hit.pulse.peak_n)
    peaks = np.array([hit.pulse.peak_n for hit in ordered])
    gaps = np.flatnonzero(peaks[1:] >= SAME_LEVEL * peaks[:-1]) + 1
    return tuple(tuple(ordered[i] for i in own) for own in np.split(np.arange(len(hits)), gaps))


def level_of(peaks_n: np.ndarray, groups: Sequence[np.ndarray]) -> np.ndarray:
    """Which of the `levels` each of some peaks (n,) in N belongs to."""
    return np.searchsorted([group[0] for group in groups[1:]], peaks_n, side="right")


def levels(peaks_n: np.ndarray) -> list[np.ndarray]:
    """Peaks (n,) in N, sorted, by level: weakest first.

    Clusters in logarithms by average linkage: means of two levels differ by SAME_LEVEL or more,
    also where forces in between leave no gap.
    """
    from scipy.cluster.hierarchy import fcluster, linkage

    if len(peaks_n) < 2:
        return [peaks_n]
    logarithms = np.log(np.maximum(peaks_n, np.finfo(float).tiny))
    level = fcluster(linkage(logarithms[:, None], "average"), np.log(SAME_LEVEL), "distance")
    return np.split(peaks_n, np.flatnonzero(np.diff(level)) + 1)
