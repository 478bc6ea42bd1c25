"""Stability lobes: at each speed the first loss of stability, its kind and chatter frequency.

The largest multiplier |µ| is looked at from zero depth upwards, in steps that follow the
zeroth-order floor instead of the depths that are asked for. The first step over which it passes one
is refined, so that islands of stability beyond do not matter. What is left unseen is a strip of
instability narrower than a step whose |µ| does not show beside it.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import root_scalar

from planner.inference.parallel import side_by_side
from planner.milling.machine import Machine, Monodromies, check_structure, limits, multipliers
from planner.milling.period import Period
from planner.progress import Tell, quietly

LEAST_STEPS = 16  # of the scan in all
GROWTH = 1.045
CHUNK = 12  # depths that are scanned at once


@dataclass(frozen=True)
class GrowthAtDepth:
    """A depth in m and log |µ| there."""

    depth: float
    size: float


def scanned_depths(floor_m: float, most_m: float) -> np.ndarray:
    """(B,) depths from the first step to the largest."""
    # Steps of the scan up to the zeroth-order floor: flips may come before it
    step = min(floor_m / 6, most_m / LEAST_STEPS)
    # Steps of the same length, before they grow with the depth
    equal = step * np.arange(1, 24 + 1)
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
        # A maximum of |µ| above this, between steps, is looked at more closely.
        if b.size > np.log(0.9) and b.size >= max(a.size, c.size):
            # So many depths then are looked at.
            more += levels(at, np.linspace(a.depth, c.depth, 9 + 2)[1:-1])
    return sorted([*seen, *more], key=lambda level: level.depth)


def refined(at: Monodromies, low: GrowthAtDepth, high: GrowthAtDepth, width: float = 1e-6) -> float:
    """Depth at which |µ| is one between two, to a relative `width`."""
    known = {low.depth: low.size, high.depth: high.size}

    def size(depth: float) -> float:
        return known[depth] if depth in known else levels(at, np.array([depth]))[0].size

    return float(root_scalar(size, bracket=(low.depth, high.depth), xtol=width * high.depth).root)


MANY, BLOCK = 60, 10  # speeds from which two processes share them, in blocks of so many


@dataclass(frozen=True)
class Loss:
    """First loss at one speed: depth in m (NaN: none), kind, chatter frequency, relative error."""

    depth_m: float
    kind: str | None = None
    chatter_hz: float = np.nan
    error: float = np.nan
    points: int = 0


NO_LOSS = Loss(np.nan)


def losses(machine: Machine, tell: Tell = quietly) -> tuple[Loss, ...]:
    """At each speed of the cut, up to its largest depth, by its method."""
    check_structure(machine.modes)
    cut = machine.cut
    if cut.method == "zeroth_order":
        return zeroth_losses(machine)
    scan = scanned_depths(machine.floor().floor_m, cut.depth_m[1])
    speeds = [float(rpm) for rpm in cut.speeds_rpm]
    if len(speeds) < MANY:
        return tuple(full_loss(machine, rpm, scan) for rpm in speeds)
    blocks = [speeds[i : i + BLOCK] for i in range(0, len(speeds), BLOCK)]
    found = side_by_side(
        lambda block: [full_loss(machine, rpm, scan) for rpm in block],
        blocks,
        lambda number, count: tell("lobes", count / len(blocks)),
    )
    return tuple(loss for block in found for loss in block)


def zeroth_losses(machine: Machine) -> tuple[Loss, ...]:
    """By the average of the cutting force; kind and error are not known to it, kinds are Hopf."""
    cut = machine.cut
    depths, chatter = limits(machine.floor(), cut.speeds_rpm, cut.teeth)
    return tuple(
        Loss(depth, "hopf", hertz) if depth <= cut.depth_m[1] else NO_LOSS
        for depth, hertz in zip(depths, chatter, strict=True)
    )


def full_loss(machine: Machine, rpm: float, scan: np.ndarray) -> Loss:
    """By full discretisation, with as many points per period as it needs."""
    at = machine.monodromies(rpm)
    bracket = first_unstable(at, scan)
    if bracket is None:
        return NO_LOSS
    depth = refined(at, *bracket)
    factor, error = 1.0, np.inf
    # Rounds of adding points
    for _ in range(5):
        # Finer: factor on the points, for the check
        factor *= 1.5
        at = machine.monodromies(rpm, factor)
        found = _again(at, depth, scan)
        if found is None:
            return NO_LOSS
        error, depth = abs(found - depth) / depth, found
        # Depth error: relative, up to which points per period are added
        if error < 3e-4:
            break
    return _told(machine, rpm, factor, depth, error)


def _again(at: Monodromies, depth: float, scan: np.ndarray) -> float | None:
    """With other points: near where it was, else by another scan."""
    low, high = levels(at, depth * np.array([0.998, 1.002]))
    if low.size < 0 < high.size:
        return refined(at, low, high)
    bracket = first_unstable(at, scan)
    return None if bracket is None else refined(at, *bracket)


def _told(machine: Machine, rpm: float, factor: float, depth: float, error: float) -> Loss:
    """Kind and chatter frequency at a limit."""
    built = machine.period(rpm, machine.grid(rpm, factor), depth)
    values, vectors = np.linalg.eig(built.monodromy(np.array([depth]))[0])
    top = int(np.argmax(np.abs(values)))
    mu = complex(values[top])
    flip = abs(mu.imag) < 1e-7 * abs(mu) and mu.real < 0
    hertz = chatter_frequency(machine, built, mu, vectors[:, top], depth)
    return Loss(depth, "flip" if flip else "hopf", hertz, error, len(built.seen))


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
