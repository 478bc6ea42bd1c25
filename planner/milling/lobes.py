"""Stability lobes: at each speed the first loss of stability, its kind and chatter frequency."""

from dataclasses import dataclass

import numpy as np

from planner.inference.parallel import side_by_side
from planner.milling.first_loss import first_unstable, near, refined, scanned_depths
from planner.milling.machine import Machine, Monodromies, check_structure
from planner.milling.period import Period
from planner.milling.semi_discretisation import semi_monodromies
from planner.milling.zeroth_order import limits
from planner.progress import Tell, quietly

DEPTH_ERROR = 3e-4  # relative, up to which points per period are added
FINER = 1.5  # factor on the points, for the check
MANY, BLOCK = 60, 10  # speeds from which two processes share them, in blocks of so many
ROUNDS = 5  # of adding points
SEMI_FINER = 2.0  # factor on the steps of a semi-discretisation, whose error falls with the square


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
    one = full_loss if cut.method == "full_discretisation" else semi_loss
    scan = scanned_depths(machine.floor().floor_m, cut.depth_m[1])
    speeds = [float(rpm) for rpm in cut.speeds_rpm]
    if len(speeds) < MANY:
        return tuple(one(machine, rpm, scan) for rpm in speeds)
    blocks = [speeds[i : i + BLOCK] for i in range(0, len(speeds), BLOCK)]
    found = side_by_side(
        lambda block: [one(machine, rpm, scan) for rpm in block],
        blocks,
        lambda number, count: tell("lobes", count / len(blocks)),
    )
    return tuple(loss for block in found for loss in block)


def zeroth_losses(machine: Machine) -> tuple[Loss, ...]:
    """By the average of the cutting force; kind and error are not known to it, kinds are Hopf."""
    cut = machine.cut
    found = limits(machine.floor(), cut.speeds_rpm, cut.teeth)
    return tuple(
        Loss(depth, "hopf", hertz) if depth <= cut.depth_m[1] else NO_LOSS
        for depth, hertz in zip(found.depth_m, found.chatter_hz, strict=True)
    )


def full_loss(machine: Machine, rpm: float, scan: np.ndarray) -> Loss:
    """By full discretisation, with as many points per period as it needs."""
    at = machine.monodromies(rpm)
    bracket = first_unstable(at, scan)
    if bracket is None:
        return NO_LOSS
    depth, slope = refined(at, *bracket)
    factor, error = 1.0, np.inf
    for _ in range(ROUNDS):
        factor *= FINER
        at = machine.monodromies(rpm, factor)
        found = _again(at, depth, slope, scan)
        if found is None:
            return NO_LOSS
        error, (depth, slope) = abs(found[0] - depth) / depth, found
        if error < DEPTH_ERROR:
            break
    return _told(machine, rpm, factor, depth, error)


def _again(
    at: Monodromies, depth: float, slope: float, scan: np.ndarray
) -> tuple[float, float] | None:
    """With other points: near where it was, else by another scan."""
    found = near(at, depth, slope)
    if found is not None:
        return found
    bracket = first_unstable(at, scan)
    return None if bracket is None else refined(at, *bracket)


def semi_loss(machine: Machine, rpm: float, scan: np.ndarray) -> Loss:
    """By semi-discretisation, extrapolated from two numbers of steps to infinitely many."""
    at = semi_monodromies(machine, rpm)
    bracket = first_unstable(at, scan)
    if bracket is None:
        return NO_LOSS
    depth, slope = refined(at, *bracket)
    found = _again(semi_monodromies(machine, rpm, SEMI_FINER), depth, slope, scan)
    if found is None:
        return NO_LOSS
    more = (found[0] - depth) / (SEMI_FINER**2 - 1)
    told = _told(machine, rpm, 1.0, found[0] + more, abs(more) / depth)
    return told


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
