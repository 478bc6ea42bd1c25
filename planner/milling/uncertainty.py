"""Which depth is stable with a probability: limits of samples of structure and coefficients."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.inference.parallel import side_by_side
from planner.milling.lobes import (
    GrowthAtDepth,
    Loss,
    first_unstable,
    levels,
    losses,
    refined,
    scanned_depths,
)
from planner.milling.machine import Machine
from planner.progress import Tell, quietly

PROBABILITY = 0.95  # that the robust depth is stable
OPEN = 0.05  # of a limit: half of what holds 90 % of its samples, beyond which it is not known
REPLICATES = 4  # Latin hypercubes, whose difference shows how far quantiles have converged
# Shares of the limit without uncertainty at which samples are looked at first.
FIRST = np.array([0.4, 0.6, 0.75, 0.88, 1.0, 1.15, 1.4])
MOST_SPEEDS = 100  # at which samples are looked at; between them their limits are interpolated


@dataclass(frozen=True, eq=False)
class SampledLimits:
    """Depths (samples, speeds) in m at which each sample first loses stability; inf: never."""

    depth_m: np.ndarray

    def robust(self, probability: float = PROBABILITY) -> np.ndarray:
        """(n,) the depth that is stable with a probability, inf where no loss is so likely."""
        return _quantile(self.depth_m, 1 - probability)

    def robust_sd(self, probability: float = PROBABILITY) -> np.ndarray:
        """(n,) standard error of `robust` by replicates, relative."""
        parts = np.array_split(self.depth_m, REPLICATES)
        found = np.array([_quantile(part, 1 - probability) for part in parts])
        with np.errstate(invalid="ignore"):
            return np.std(found, axis=0, ddof=1) / np.sqrt(REPLICATES) / np.mean(found, axis=0)

    def open(self, depth_m: np.ndarray) -> np.ndarray:
        """(n,) bool: where limits (n,) in m (NaN: none) may well be others."""
        low, high = np.quantile(self.depth_m, (0.05, 0.95), axis=0, method="nearest")
        with np.errstate(invalid="ignore"):
            known = (high - low) / 2 <= OPEN * depth_m
        return ~known & ~(np.isinf(low) & ~np.isfinite(depth_m))

    def probability(self, depths: np.ndarray) -> np.ndarray:
        """(speeds, depths) of being stable at depths (b,) in m."""
        return np.mean(self.depth_m[:, :, None] > depths, axis=0)


def _quantile(values: np.ndarray, share: float) -> np.ndarray:
    """(n,) linear between samples (s, n), inf where the upper of two is."""
    ordered = np.sort(values, axis=0)
    at = share * (len(values) - 1)
    low = int(np.floor(at))
    high = min(low + 1, len(values) - 1)
    with np.errstate(invalid="ignore"):
        between = ordered[low] + (at - low) * (ordered[high] - ordered[low])
    return np.where(np.isfinite(ordered[high]), between, ordered[low])


def sampled_limits(
    machines: Sequence[Machine], nominal: Sequence[Loss], tell: Tell = quietly
) -> SampledLimits:
    """Of samples of a machine whose own first losses are known, at the same speeds."""
    around = np.array([loss.depth_m for loss in nominal])
    chosen = np.unique(np.linspace(0, len(around) - 1, min(len(around), MOST_SPEEDS)).round())
    chosen = chosen.astype(int)

    def one(machine: Machine) -> np.ndarray:
        if machine.cut.method == "zeroth_order":
            found = np.array([loss.depth_m for loss in losses(machine)])
            return np.where(np.isnan(found), np.inf, found)
        found = _limits(machine, machine.cut.speeds_rpm[chosen], around[chosen])
        return _between(around, chosen, found)

    def done(number: int, count: int) -> None:
        tell("samples", count / len(machines))

    return SampledLimits(np.array(side_by_side(one, list(machines), done)))


def _between(around: np.ndarray, chosen: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(n,) from limits (m,) of a sample at some speeds: as shares of those of what is expected.

    Where either has no limit beside a speed depths are interpolated, inf beside inf.
    """
    at = np.arange(len(around))
    finite = np.where(np.isfinite(values), values, 0.0)
    beyond = np.interp(at, chosen, np.isinf(values).astype(float)) > 0
    depth = np.where(beyond, np.inf, np.interp(at, chosen, finite))
    share = np.interp(at, chosen, finite / around[chosen])  # NaN beside what has no limit
    return np.where(np.isfinite(share * around) & ~beyond, share * around, depth)


def _limits(machine: Machine, rpm: np.ndarray, around: np.ndarray) -> np.ndarray:
    """(n,): where |µ| passes one, by full discretisation without further points per period."""
    most = machine.cut.depth_m[1]
    scan = scanned_depths(machine.floor().floor_m, most)
    found = np.full(len(around), np.inf)
    for i, speed in enumerate(rpm):
        at = machine.monodromies(float(speed))
        bracket = None
        if np.isfinite(around[i]):
            bracket = _bracket(levels(at, FIRST * around[i]))
        if bracket is None:
            above = scan if np.isnan(around[i]) else scan[scan > FIRST[-1] * around[i]]
            bracket = first_unstable(at, above) if len(above) else None
        if bracket is not None:
            found[i] = refined(at, *bracket, 1e-3)
    return found


def _bracket(seen: list[GrowthAtDepth]) -> tuple[GrowthAtDepth, GrowthAtDepth] | None:
    """The first loss among levels that are coarse; before the first of them it is stable."""
    before = GrowthAtDepth(0.0, -1.0)
    for level in seen:
        if level.size > 0:
            return before, level
        before = level
    return None
