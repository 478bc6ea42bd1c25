"""Stability lobes: at each speed the depth at which stability is first lost, found between points.

At every depth the largest multiplier of the monodromy is looked at. Depths are scanned from zero
upwards in steps that follow the zeroth-order floor, not the points that are asked for; the first
step over which stability is lost is refined, then checked with more points per period.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.errors import InputError
from planner.milling.cut import Cut
from planner.milling.cutter_modes import CutterModes
from planner.milling.directional import Coefficients, mean_matrix
from planner.milling.period import Grid, Period, period
from planner.milling.zeroth_order import Curves, curves
from planner.progress import Tell, quietly

STEPS_TO_FLOOR = 8  # of the scan, up to the zeroth-order floor; loss below it is rare (flip)
EQUAL_STEPS = 32  # of that length, before steps grow with the depth
GROWTH = 1.03
CHUNK = 12  # depths that are scanned at once
DEPTH_ERROR = 3e-4  # relative, up to which points per period are added
REFINED = 1e-6  # relative width up to which a loss is refined
NEARLY = 0.9  # a maximum of the multiplier above this, between steps, is looked at more closely
CLOSER = 9  # depths that then are looked at
POINTS, PER_RADIAN = 8, 0.55  # points of a period: for 1e-4 in the depth, from one-mode cuts
MOST_DEGREE = 32
FINER = 1.5  # factor on the points, for the check
ROUNDS = 5  # of adding points


@dataclass(frozen=True)
class Loss:
    """First loss at one speed: depth in m (NaN: none), kind, chatter frequency, relative error."""

    depth_m: float
    kind: str | None
    chatter_hz: float
    error: float
    points: int


@dataclass(frozen=True, eq=False)
class Machine:
    """A structure and a cut: whatever gives a period's matrices at a speed."""

    modes: CutterModes  # in the plane of the cut
    cut: Cut
    coefficients: Coefficients

    def grid(self, rpm: float, factor: float = 1.0) -> Grid:
        """As fine as the highest mode asks for at this speed, times a factor."""
        start, end = self.cut.immersion_rad
        speed = rpm * 2 * np.pi / 60
        fastest = float(np.max(np.abs(self.modes.poles)))
        arc = min(end - start, 2 * np.pi / self.cut.teeth)
        points = factor * (POINTS + PER_RADIAN * fastest * arc / speed)
        elements = int(np.ceil(points / MOST_DEGREE))
        return Grid(int(np.ceil(points / elements)), arc / elements * (1 + 1e-9))

    def period(self, rpm: float, grid: Grid, depth_m: float) -> Period:
        """Matrices of a period; `depth_m` matters with a helix only."""
        return period(self.modes, self.cut, self.coefficients, rpm, grid, depth_m)

    def monodromies(self, rpm: float, grid: Grid) -> Callable[[np.ndarray], list[np.ndarray]]:
        """A function of depths (B,) that gives their monodromy matrices."""
        if self.cut.lag_rad_m == 0:
            built = self.period(rpm, grid, 0.0)
            return lambda depths: list(built.monodromy(depths))
        return lambda depths: [
            self.period(rpm, grid, float(b)).monodromy(np.array([b]))[0] for b in depths
        ]

    def floor(self) -> Curves:
        """Zeroth-order curves, over lines that resolve every mode."""
        lines = resolving_lines(self.modes)
        mean = mean_matrix(self.cut, self.coefficients)
        return curves(lines, self.modes.receptance(lines), mean)


def resolving_lines(modes: CutterModes) -> np.ndarray:
    """(F,) Hz: dense about each mode within its half-power band, and between."""
    hertz, width = np.abs(modes.poles) / (2 * np.pi), -modes.poles.real / (2 * np.pi)
    near = np.sinh(np.linspace(-9, 9, 241)) / 4  # half-widths: steps grow away from the mode
    lines = (hertz[:, None] + width[:, None] * near).ravel()
    wide = np.geomspace(hertz.min() / 20, hertz.max() * 20, 400)
    lines = np.concatenate([lines, wide])
    return np.unique(lines[(lines > wide[0]) & (lines < wide[-1])])


def multipliers(matrices: list[np.ndarray]) -> np.ndarray:
    """(B,) complex: of each monodromy the eigenvalue of largest size, imaginary part ≥ 0."""
    found = np.empty(len(matrices), complex)
    sizes = {m.shape for m in matrices}
    for size in sizes:
        which = [i for i, m in enumerate(matrices) if m.shape == size]
        values = np.linalg.eigvals(np.array([matrices[i] for i in which]))
        top = values[np.arange(len(which)), np.argmax(np.abs(values), axis=1)]
        found[which] = top.real + 1j * np.abs(top.imag)
    return found


def losses(machine: Machine, tell: Tell = quietly) -> tuple[Loss, ...]:
    """At each speed of the cut, up to its largest depth."""
    check_structure(machine.modes)
    most = machine.cut.depth_m[1]
    scan = scanned_depths(machine.floor().floor_m, most)
    found = []
    speeds = machine.cut.speeds_rpm
    for i, rpm in enumerate(speeds):
        found.append(first_loss(machine, float(rpm), scan))
        tell("speeds", (i + 1) / len(speeds))
    return tuple(found)


def check_structure(modes: CutterModes) -> None:
    """InputError where the structure is unstable or does not move in the plane of the cut."""
    if not len(modes.poles):
        raise InputError(
            "No mode moves in the plane of the cut; check feed and axis in the cut's file."
        )
    if np.any(modes.poles.real >= 0):
        raise InputError("The structure has a mode without damping; correct its damping ratio.")


def scanned_depths(floor_m: float, most_m: float) -> np.ndarray:
    """(B,) depths from the first step to the largest."""
    step = min(floor_m / STEPS_TO_FLOOR, most_m / 4)
    equal = step * np.arange(1, EQUAL_STEPS + 1)
    count = max(0, int(np.ceil(np.log(max(most_m / equal[-1], 1.0)) / np.log(GROWTH))))
    depths = np.concatenate([equal, equal[-1] * GROWTH ** np.arange(1, count + 1)])
    return np.append(depths[depths < most_m * (1 - 1e-9)], most_m)


def first_loss(machine: Machine, rpm: float, scan: np.ndarray) -> Loss:
    """First loss at a speed, refined, with as many points per period as it needs."""
    grid = machine.grid(rpm)
    at = machine.monodromies(rpm, grid)
    bracket = _first_unstable(at, scan)
    if bracket is None:
        return Loss(np.nan, None, np.nan, np.nan, grid.degree)
    depth, slope = _refined(at, *bracket)
    factor, error = 1.0, np.inf
    for _ in range(ROUNDS):
        factor *= FINER
        grid = machine.grid(rpm, factor)
        at = machine.monodromies(rpm, grid)
        off = np.log(np.abs(multipliers(at(np.array([depth])))[0]))
        moved = -off / slope
        error = abs(moved) / depth
        if error < REFINED:
            break
        near = depth + moved + 2 * abs(moved) * np.array([-1.0, 1.0])
        low, high = np.clip(near, scan[0] * 1e-3, None)
        sizes = np.log(np.abs(multipliers(at(np.array([low, high])))))
        if sizes[0] < 0 < sizes[1]:
            depth, slope = _refined(at, low, high, sizes[0], sizes[1])
        else:
            found = _first_unstable(at, scan)
            if found is None:
                return Loss(np.nan, None, np.nan, np.nan, grid.degree)
            depth, slope = _refined(at, *found)
        if error < DEPTH_ERROR:
            break
    return _told(machine, rpm, grid, depth, error)


def _first_unstable(
    at: Callable[[np.ndarray], list[np.ndarray]], scan: np.ndarray
) -> tuple[float, float, float, float] | None:
    """Depths around the first loss, with log |µ| there."""
    depths, sizes = np.array([0.0]), np.array([-np.inf])
    for first in range(0, len(scan), CHUNK):
        new = scan[first : first + CHUNK]
        depths = np.append(depths, new)
        sizes = np.append(sizes, np.log(np.abs(multipliers(at(new)))))
        depths, sizes = _with_peaks(at, depths, sizes)
        over = np.flatnonzero(sizes > 0)
        if over.size:
            i = int(over[0])
            if i == 1:
                sizes[0] = np.log(np.abs(multipliers(at(np.array([0.0])))[0]))
            return depths[i - 1], depths[i], sizes[i - 1], sizes[i]
        depths, sizes = depths[-2:], sizes[-2:]
    return None


def _with_peaks(
    at: Callable[[np.ndarray], list[np.ndarray]], depths: np.ndarray, sizes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """With more depths where the multiplier has a maximum below one that may reach it between."""
    until = int(np.argmax(sizes > 0)) if np.any(sizes > 0) else len(sizes)
    middle = np.arange(1, min(until, len(sizes) - 1))
    peaks = [
        i for i in middle
        if sizes[i] > np.log(NEARLY) and sizes[i] >= sizes[i - 1] and sizes[i] >= sizes[i + 1]
    ]  # fmt: skip
    for i in peaks:
        new = np.linspace(depths[i - 1], depths[i + 1], CLOSER + 2)[1:-1]
        depths = np.append(depths, new)
        sizes = np.append(sizes, np.log(np.abs(multipliers(at(new)))))
    order = np.argsort(depths)
    return depths[order], sizes[order]


def _refined(
    at: Callable[[np.ndarray], list[np.ndarray]], low: float, high: float, at_low: float,
    at_high: float,
) -> tuple[float, float]:  # fmt: skip
    """Depth at which log |µ| is zero, and its slope there, by the Illinois rule."""
    kept, slope = 0, 1.0
    if not np.isfinite(at_low):
        at_low = -at_high
    for _ in range(60):
        slope = (at_high - at_low) / (high - low)
        new = high - at_high / slope
        if not low < new < high:
            new = (low + high) / 2
        size = float(np.log(np.abs(multipliers(at(np.array([new])))[0])))
        if size > 0:
            high, at_high = new, size
            at_low = at_low / 2 if kept == 1 else at_low
            kept = 1
        else:
            low, at_low = new, size
            at_high = at_high / 2 if kept == -1 else at_high
            kept = -1
        if high - low < REFINED * high or abs(size) < 1e-9:
            break
    slope = max(abs(slope), 1e-12)
    return (low + high) / 2, slope


def _told(machine: Machine, rpm: float, grid: Grid, depth: float, error: float) -> Loss:
    """Kind and chatter frequency at a limit."""
    built = machine.period(rpm, grid, depth)
    values, vectors = np.linalg.eig(built.monodromy(np.array([depth]))[0])
    top = int(np.argmax(np.abs(values)))
    mu = values[top]
    flip = abs(mu.imag) < 1e-7 * abs(mu) and mu.real < 0
    hertz = chatter_frequency(machine.modes, built, mu, vectors[:, top], depth)
    return Loss(depth, "flip" if flip else "hopf", hertz, error, len(built.seen))


def chatter_frequency(
    modes: CutterModes, built: Period, mu: complex, vector: np.ndarray, depth: float
) -> float:
    """Of the frequencies that a multiplier stands for, the one at which the cutter moves most."""
    highest = 1.5 * float(np.max(np.abs(modes.poles))) / (2 * np.pi)
    count = int(np.ceil(highest * built.duration_s)) + 1
    hertz = np.angle(mu) / (2 * np.pi * built.duration_s) + np.arange(-count, count + 1) / (
        built.duration_s
    )
    force = built.force.T * (built.forces(vector, mu, depth) * built.weight_s)  # (2, m)
    waves = np.exp(-2j * np.pi * built.time_s[:, None] * hertz)
    moved = np.einsum("fij,jf->fi", modes.receptance(hertz), force @ waves)
    return float(abs(hertz[np.argmax(np.linalg.norm(moved, axis=1))]))
