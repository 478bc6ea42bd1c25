"""The depth at which stability is first lost, coming from zero: found between points.

The largest multiplier |µ| is looked at from zero upwards, in steps that follow the zeroth-order
floor instead of the depths that are asked for. The first step over which it passes one is refined,
so that islands of stability beyond do not matter. What is left unseen is a strip of instability
narrower than a step whose |µ| does not show beside it.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from planner.milling.machine import Monodromies, multipliers

STEPS_TO_FLOOR = 6  # of the scan, up to the zeroth-order floor; flips may come before it
LEAST_STEPS = 16  # of the scan in all
EQUAL_STEPS = 24  # of the same length, before steps grow with the depth
GROWTH = 1.045
CHUNK = 12  # depths that are scanned at once
REFINED = 1e-6  # relative width up to which a loss is refined
AT_ONE = 1e-9  # |log |µ|| that is zero
MOST_ROUNDS = 60
NEARLY = 0.9  # a maximum of |µ| above this, between steps, is looked at more closely
CLOSER = 9  # depths that then are looked at


@dataclass(frozen=True)
class GrowthAtDepth:
    """A depth in m and log |µ| there."""

    depth: float
    size: float


def scanned_depths(floor_m: float, most_m: float) -> np.ndarray:
    """(B,) depths from the first step to the largest."""
    step = min(floor_m / STEPS_TO_FLOOR, most_m / LEAST_STEPS)
    equal = step * np.arange(1, EQUAL_STEPS + 1)
    count = max(0, int(np.ceil(np.log(max(most_m / equal[-1], 1.0)) / np.log(GROWTH))))
    depths = np.concatenate([equal, equal[-1] * GROWTH ** np.arange(1, count + 1)])
    return np.append(depths[depths < most_m * (1 - 1e-9)], most_m)


def levels(at: Monodromies, depths: np.ndarray) -> list[GrowthAtDepth]:
    """Of depths (B,)."""
    sizes = np.log(np.maximum(np.abs(multipliers(at(depths))), 1e-300))
    return [GrowthAtDepth(float(b), float(s)) for b, s in zip(depths, sizes, strict=True)]


def first_unstable(at: Monodromies, scan: np.ndarray) -> tuple[GrowthAtDepth, GrowthAtDepth] | None:
    """The last stable depth before the first that is not."""
    seen = levels(at, np.array([0.0]))
    for first in range(0, len(scan), CHUNK):
        seen += levels(at, scan[first : first + CHUNK])
        seen = _with_peaks(at, seen)
        for low, high in pairwise(seen):
            if high.size > 0:
                return low, high
        seen = seen[-2:]
    return None


def _with_peaks(at: Monodromies, seen: list[GrowthAtDepth]) -> list[GrowthAtDepth]:
    """With more depths where |µ| has a maximum below one that may reach it between."""
    more: list[GrowthAtDepth] = []
    for a, b, c in zip(seen, seen[1:], seen[2:], strict=False):
        if b.size > 0:
            break
        if b.size > np.log(NEARLY) and b.size >= max(a.size, c.size):
            more += levels(at, np.linspace(a.depth, c.depth, CLOSER + 2)[1:-1])
    return sorted([*seen, *more], key=lambda level: level.depth)


def refined(
    at: Monodromies, low: GrowthAtDepth, high: GrowthAtDepth, width: float = REFINED
) -> tuple[float, float]:
    """Depth at which |µ| is one between two, and the slope of log |µ| there (Illinois rule).

    `width` is the relative one of the last bracket.
    """
    weight, last, slope = (1.0, 1.0), None, 1.0
    for _ in range(MOST_ROUNDS):
        a, b = low.size * weight[0], high.size * weight[1]
        depth = high.depth - b * (high.depth - low.depth) / (b - a)
        if not low.depth < depth < high.depth:
            depth = (low.depth + high.depth) / 2
        (new,) = levels(at, np.array([depth]))
        above = new.size > 0
        if above:
            high, weight = new, (weight[0] / 2 if last is True else 1.0, 1.0)
        else:
            low, weight = new, (1.0, weight[1] / 2 if last is False else 1.0)
        last = above
        slope = (high.size - low.size) / (high.depth - low.depth)
        close = width * high.depth
        if high.depth - low.depth < close or abs(new.size) < max(AT_ONE, slope * close / 10):
            break
    return (low if abs(low.size) < high.size else high).depth, slope


def near(at: Monodromies, depth: float, slope: float) -> tuple[float, float] | None:
    """The same from a depth that is nearly it, with its slope; None where that leads nowhere."""
    (here,) = levels(at, np.array([depth]))
    moved = -here.size / slope
    if abs(moved) < REFINED * depth:
        return depth + moved, slope
    far = depth + 2 * moved
    if not 0 < far < 2 * depth:
        return None
    (there,) = levels(at, np.array([far]))
    low, high = sorted((here, there), key=lambda level: level.depth)
    return refined(at, low, high) if low.size < 0 < high.size else None
