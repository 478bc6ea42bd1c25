"""Stability lobes: at each speed the first loss of stability, its kind and chatter frequency.

The largest multiplier |µ| is looked at from zero depth upwards, in steps that follow the
zeroth-order floor instead of the depths that are asked for. The first step over which it passes one
is refined, so that islands of stability beyond do not matter. What is left unseen is a strip of
instability narrower than a step whose |µ| does not show beside it.

Limits of samples of structure and coefficients say which depth is stable with a probability.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import root_scalar

from planner.inference.parallel import parallel_map
from planner.milling.machine import (
    Machine,
    Monodromies,
    check_structure,
    limits,
    multipliers,
    semi_monodromies,
)
from planner.milling.period import Period
from planner.progress import ProgressCallback, no_progress

LEAST_STEPS = 16  # of the scan in all
GROWTH = 1.045
CHUNK = 12  # depths that are scanned at once


ROUNDING = 1e-12  # of log |µ|: an undamped mode has |µ| = 1 at any depth
Level = tuple[float, float]  # a depth in m, and log |µ| there, beyond rounding


def scanned_depths(floor_m: float, most_m: float) -> np.ndarray:
    """(B,) depths from the first step to the largest."""
    # Steps of the scan up to the zeroth-order floor: flips may come before it
    step = min(floor_m / 6, most_m / LEAST_STEPS)
    # Steps of the same length, before they grow with the depth
    equal = step * np.arange(1, 24 + 1)
    count = max(0, int(np.ceil(np.log(max(most_m / equal[-1], 1.0)) / np.log(GROWTH))))
    depths = np.concatenate([equal, equal[-1] * GROWTH ** np.arange(1, count + 1)])
    return np.append(depths[depths < most_m * (1 - 1e-9)], most_m)


def levels(at: Monodromies, depths: np.ndarray) -> list[Level]:
    """Of depths (B,)."""
    sizes = np.log(np.maximum(np.abs(multipliers(at(depths))), 1e-300)) - ROUNDING
    return [(float(b), float(s)) for b, s in zip(depths, sizes, strict=True)]


def first_unstable(at: Monodromies, scan: np.ndarray) -> tuple[Level, Level] | None:
    """The last stable depth before the first that is not."""
    seen = levels(at, np.array([0.0]))
    for first in range(0, len(scan), CHUNK):
        seen += levels(at, scan[first : first + CHUNK])
        seen = _with_peaks(at, seen)
        if (bracket := _bracket(seen)) is not None:
            return bracket
        seen = seen[-2:]
    return None


def _bracket(seen: list[Level]) -> tuple[Level, Level] | None:
    """The first loss among levels, the first of which is stable."""
    return next(((low, high) for low, high in pairwise(seen) if high[1] > 0), None)


def _with_peaks(at: Monodromies, seen: list[Level]) -> list[Level]:
    """With more depths where |µ| has a maximum below one that may reach it between."""
    more: list[Level] = []
    for a, b, c in zip(seen, seen[1:], seen[2:], strict=False):
        if b[1] > 0:
            break
        # A maximum of |µ| above this, between steps, is looked at more closely.
        if b[1] > np.log(0.9) and b[1] >= max(a[1], c[1]):
            # So many depths then are looked at.
            more += levels(at, np.linspace(a[0], c[0], 9 + 2)[1:-1])
    return sorted([*seen, *more])


def refined(at: Monodromies, low: Level, high: Level, width: float = 1e-6) -> float:
    """Depth at which |µ| is one between two, to a relative `width`."""
    known = dict((low, high))

    def size(depth: float) -> float:
        return known[depth] if depth in known else levels(at, np.array([depth]))[0][1]

    return float(root_scalar(size, bracket=(low[0], high[0]), xtol=width * high[0]).root)


MANY = 60  # speeds from which two processes share them


@dataclass(frozen=True)
class StabilityLimit:
    """First loss at one speed: depth in m (inf: none), kind, chatter frequency, relative error."""

    depth_m: float
    kind: str | None = None
    chatter_hz: float = np.nan
    error: float = np.nan


NO_LIMIT = StabilityLimit(np.inf)


def depths_of(losses: Sequence[StabilityLimit]) -> np.ndarray:
    """(n,) in m, inf where nothing is lost."""
    return np.array([loss.depth_m for loss in losses])


def stability_limits(
    machine: Machine, progress: ProgressCallback = no_progress
) -> tuple[StabilityLimit, ...]:
    """At each speed of the cut, up to its largest depth, by its method."""
    check_structure(machine.modes)
    cut = machine.cut
    if cut.method == "zeroth_order":
        # By the average of the cutting force; kinds are Hopf, the error is not known.
        found = zip(*limits(machine.floor(), cut.speeds_rpm, cut.teeth), strict=True)
        return tuple(
            StabilityLimit(d, "hopf", hz) if d <= cut.depth_m[1] else NO_LIMIT for d, hz in found
        )
    scan = scanned_depths(machine.floor().floor_m, cut.depth_m[1])
    speeds = [float(rpm) for rpm in cut.speeds_rpm]

    def at_speed(rpm: float) -> StabilityLimit:
        return discretised_limit(machine, rpm, scan)

    if len(speeds) < MANY:
        return tuple(map(at_speed, speeds))
    told = parallel_map(at_speed, speeds, lambda _, n: progress("lobes", n / len(speeds)))
    return tuple(told)


def monodromies(machine: Machine, rpm: float, factor: float = 1.0) -> Monodromies:
    """By the cut's method of discretisation; `factor` multiplies the points per period."""
    if machine.cut.method == "semi_discretisation":
        return semi_monodromies(machine, rpm, factor)
    return machine.monodromies(rpm, factor)


def discretised_limit(machine: Machine, rpm: float, scan: np.ndarray) -> StabilityLimit:
    """With as many points per period as it needs."""
    at = monodromies(machine, rpm)
    bracket = first_unstable(at, scan)
    if bracket is None:
        return NO_LIMIT
    depth = refined(at, *bracket)
    factor, error = 1.0, np.inf
    # Rounds of adding points
    for _ in range(5):
        # Finer: factor on the points, for the check
        factor *= 1.5
        at = monodromies(machine, rpm, factor)
        found = _again(at, depth, scan)
        if found is None:
            return NO_LIMIT
        error, depth = abs(found - depth) / depth, found
        # Depth error: relative, up to which points per period are added
        if error < 3e-4:
            break
    return _told(machine, rpm, factor, depth, error)


def _again(at: Monodromies, depth: float, scan: np.ndarray) -> float | None:
    """With other points: near where it was, else by another scan."""
    low, high = levels(at, depth * np.array([0.998, 1.002]))
    if low[1] < 0 < high[1]:
        return refined(at, low, high)
    bracket = first_unstable(at, scan)
    return None if bracket is None else refined(at, *bracket)


def _told(
    machine: Machine, rpm: float, factor: float, depth: float, error: float
) -> StabilityLimit:
    """Kind and chatter frequency at a limit."""
    built = machine.period(rpm, factor, depth)
    values, vectors = np.linalg.eig(built.monodromy(np.array([depth]))[0])
    top = int(np.argmax(np.abs(values)))
    mu = complex(values[top])
    flip = abs(mu.imag) < 1e-7 * abs(mu) and mu.real < 0
    hertz = chatter_frequency(machine, built, mu, vectors[:, top], depth)
    return StabilityLimit(depth, "flip" if flip else "hopf", hertz, error)


def chatter_frequency(
    machine: Machine, built: Period, mu: complex, vector: np.ndarray, depth: float
) -> float:
    """Of the frequencies that a multiplier stands for, the one at which the cutter moves most."""
    rate = 1 / built.duration_s
    count = int(np.ceil(1.5 * machine.fastest / (2 * np.pi * rate))) + 1
    hertz = rate * (np.angle(mu) / (2 * np.pi) + np.arange(-count, count + 1))
    force = built.force.T * (built.forces(vector, mu, depth) * built.weight_s)  # (2, m)
    waves = np.exp(-2j * np.pi * built.time_s[:, None] * hertz)
    moved = np.einsum("fij,jf->fi", machine.modes.receptance(hertz), force @ waves)
    return float(abs(hertz[np.argmax(np.linalg.norm(moved, axis=1))]))


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

    def robust_sd(self) -> np.ndarray:
        """(n,) standard error of `robust` by replicates, relative."""
        parts = np.array_split(self.depth_m, REPLICATES)
        found = np.array([_quantile(part, 1 - PROBABILITY) for part in parts])
        with np.errstate(invalid="ignore"):
            return np.std(found, axis=0, ddof=1) / np.sqrt(REPLICATES) / np.mean(found, axis=0)

    def open(self, depth_m: np.ndarray) -> np.ndarray:
        """(n,) bool: where limits (n,) in m (inf: none) may well be others."""
        low, high = np.quantile(self.depth_m, (0.05, 0.95), axis=0, method="nearest")
        with np.errstate(invalid="ignore"):
            known = (high - low) / 2 <= OPEN * np.where(np.isinf(depth_m), np.nan, depth_m)
        return ~known & ~(np.isinf(low) & np.isinf(depth_m))


def _quantile(values: np.ndarray, share: float) -> np.ndarray:
    """(n,) linear between samples (s, n), the lower of two where the upper is inf."""
    with np.errstate(invalid="ignore"):
        between = np.quantile(values, share, axis=0)
    return np.where(np.isfinite(between), between, np.quantile(values, share, 0, method="lower"))


def sampled_limits(
    machines: Sequence[Machine],
    nominal: Sequence[StabilityLimit],
    progress: ProgressCallback = no_progress,
) -> SampledLimits:
    """Of samples of a machine whose own first losses are known, at the same speeds."""
    around = depths_of(nominal)
    chosen = np.unique(np.linspace(0, len(around) - 1, min(len(around), MOST_SPEEDS)).round())
    chosen = chosen.astype(int)

    def one(machine: Machine) -> np.ndarray:
        if machine.cut.method == "zeroth_order":
            return depths_of(stability_limits(machine))
        found = _limits(machine, machine.cut.speeds_rpm[chosen], around[chosen])
        return _between(around, chosen, found)

    told = parallel_map(one, list(machines), lambda _, n: progress("samples", n / len(machines)))
    return SampledLimits(np.array(told))


def _between(around: np.ndarray, chosen: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(n,) from limits (m,) of a sample at some speeds: as shares of those of what is expected.

    Where either has no limit beside a speed depths are interpolated, inf beside inf.
    """
    at = np.arange(len(around))
    finite = np.where(np.isfinite(values), values, 0.0)
    beyond = np.interp(at, chosen, np.isinf(values).astype(float)) > 0
    depth = np.where(beyond, np.inf, np.interp(at, chosen, finite))
    known = np.where(np.isinf(around), np.nan, around)  # NaN beside what has no limit
    share = np.interp(at, chosen, finite / known[chosen])
    return np.where(np.isfinite(share * known) & ~beyond, share * known, depth)


def _limits(machine: Machine, rpm: np.ndarray, around: np.ndarray) -> np.ndarray:
    """(n,): where |µ| passes one, without further points per period."""
    most = machine.cut.depth_m[1]
    scan = scanned_depths(machine.floor().floor_m, most)
    found = np.full(len(around), np.inf)
    for i, speed in enumerate(rpm):
        at = monodromies(machine, float(speed))
        bracket = None
        if np.isfinite(around[i]):
            bracket = _bracket([(0.0, -1.0), *levels(at, FIRST * around[i])])
        if bracket is None:
            above = scan if np.isinf(around[i]) else scan[scan > FIRST[-1] * around[i]]
            bracket = first_unstable(at, above) if len(above) else None
        if bracket is not None:
            found[i] = refined(at, *bracket, 1e-3)
    return found
