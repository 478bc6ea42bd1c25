"""A structure at the cutter and a cut: what every question about stability is asked of."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from planner.errors import InputError
from planner.milling.cut import Cut
from planner.milling.cutter_modes import CutterModes
from planner.milling.directional import mean_matrix, tooth_matrix
from planner.milling.period import Period, period

NOTHING = 1e-60  # 1/m: of an eigenvalue


class LobeCurves:
    """Per line (f,) and eigenvalue λ (f, 2): 1/λ in m, depth of the limit (inf: none), phase."""

    def __init__(self, frequency_hz: np.ndarray, receptance: np.ndarray, mean: np.ndarray) -> None:
        """Of receptances (f, 2, 2) in the cut's plane in m/N, and the mean matrix (2, 2), N/m²."""
        values = _followed(np.linalg.eigvals(mean @ receptance))
        # Where nothing gives way in a direction, next to nothing: its depth is beyond all others.
        self.frequency_hz, self.inverse = frequency_hz, 1 / np.where(values == 0, NOTHING, values)

    @property
    def depth_m(self) -> np.ndarray:
        """(f, 2)."""
        return _depth(self.inverse)

    @property
    def phase(self) -> np.ndarray:
        """(f, 2) of a tooth's period, but for whole turns."""
        return np.unwrap(np.pi - 2 * np.angle(self.inverse), axis=0)

    @property
    def floor_m(self) -> float:
        """The depth that is stable at any speed, inf where nothing is unstable."""
        return float(np.min(self.depth_m, initial=np.inf))

    @property
    def floor_hz(self) -> float:
        """The chatter frequency there."""
        return float(self.frequency_hz[np.argmin(np.min(self.depth_m, axis=1))])


def _depth(inverse: np.ndarray) -> np.ndarray:
    """Of 1/λ in m (…): the depth of the limit, inf where there is none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.abs(inverse) ** 2 / (2 * inverse.real)
    return np.where((inverse.real > 0) & np.isfinite(depth), depth, np.inf)


def _followed(values: np.ndarray) -> np.ndarray:
    """Eigenvalues (F, 2) in an order that makes each as continuous as can be."""
    size = np.abs(values).sum(axis=1)
    size[size == 0] = 1.0
    kept = np.abs(np.diff(values, axis=0)).sum(axis=1)
    crossed = np.abs(values[1:, ::-1] - values[:-1]).sum(axis=1)
    swap = np.concatenate([[False], crossed < kept])
    odd = np.cumsum(swap) % 2 == 1
    return np.where(odd[:, None], values[:, ::-1], values)


def limits(found: LobeCurves, rpm: np.ndarray, teeth: int) -> tuple[np.ndarray, np.ndarray]:
    """First loss at speeds (n,) in rpm: depth in m (inf: none), chatter frequency in Hz (NaN).

    Between lines 1/λ is straight.
    """
    hertz, phase = found.frequency_hz, found.phase
    depth, chatter = np.full(len(rpm), np.inf), np.full(len(rpm), np.nan)
    for i, speed in enumerate(rpm):
        turns = hertz[:, None] * 60 / (speed * teeth) - phase / (2 * np.pi)
        low = np.floor(np.fmin(turns[1:], turns[:-1])) + 1
        count = np.floor(np.fmax(turns[1:], turns[:-1])) + 1 - low
        count = np.where(np.isfinite(count), count, 0).astype(int)
        line, branch = np.nonzero(count > 0)
        # Each whole number of turns that is passed between two lines is a lobe's limit.
        each = np.repeat(np.arange(len(line)), count[line, branch])
        order = np.arange(len(each)) - np.searchsorted(each, each)
        line, branch = line[each], branch[each]
        start, step = turns[line, branch], np.diff(turns, axis=0)[line, branch]
        share = (low[line, branch] + order - start) / step
        change = np.diff(found.inverse, axis=0)[line, branch]
        here = _depth(found.inverse[line, branch] + share * change)
        if len(here) and np.isfinite(np.min(here)):
            best = int(np.argmin(here))
            depth[i] = here[best]
            chatter[i] = hertz[line[best]] + share[best] * np.diff(hertz)[line[best]]
    return depth, chatter


Monodromies = Callable[[np.ndarray], list[np.ndarray]]  # of depths (B,) in m

# Points of a period, and more of them per radian of the fastest mode: depths of one-mode cuts are
# then within 1e-4.
POINTS, PER_RADIAN = 8, 0.55
MOST_POINTS = 400  # of a period: with more, each depth takes a second


@dataclass(frozen=True, eq=False)
class Machine:
    """Modes in the plane of the cut, and the cut with the coefficients that hold."""

    modes: CutterModes
    cut: Cut

    def grid(self, rpm: float, factor: float) -> tuple[int, float]:
        """Degree of polynomials and longest element in rad, times a factor what a mode asks for."""
        start, end = self.cut.immersion_rad
        arc = min(end - start, 2 * np.pi / self.cut.teeth)
        points = factor * (POINTS + PER_RADIAN * self.fastest * arc / (rpm * 2 * np.pi / 60))
        if points > factor * MOST_POINTS:
            slowest = rpm * points / (factor * MOST_POINTS)
            raise InputError(
                f"At {rpm:g} rpm the fastest mode swings too often while a tooth cuts; ask for "
                f'{slowest:.0f} rpm or more, or choose the method "zeroth_order".'
            )
        # Most degree.
        elements = int(np.ceil(points / 32))
        return int(np.ceil(points / elements)), arc / elements * (1 + 1e-9)

    @property
    def fastest(self) -> float:
        """The highest pole's size in rad/s."""
        return float(np.max(np.abs(self.modes.poles)))

    def period(self, rpm: float, factor: float, depth_m: float) -> Period:
        """Matrices of a period; `depth_m` matters with a helix only."""
        return period(self.modes, self.cut, rpm, *self.grid(rpm, factor), depth_m)

    def monodromies(self, rpm: float, factor: float = 1.0) -> Monodromies:
        """By full discretisation, with so many times the usual points."""
        if self.cut.lag_rad_m == 0:
            built = self.period(rpm, factor, 0.0)
            return lambda depths: list(built.monodromy(depths))
        return lambda depths: [
            self.period(rpm, factor, float(b)).monodromy(np.array([b]))[0] for b in depths
        ]

    def floor(self) -> LobeCurves:
        """Zeroth-order curves over lines that resolve every mode."""
        poles = self.modes.poles
        hertz, width = np.abs(poles) / (2 * np.pi), -poles.real / (2 * np.pi)
        # Dense about each mode within its half-power band: steps, in half-widths, grow away from it
        near = np.sinh(np.linspace(-9, 9, 241)) / 4
        wide = np.geomspace(hertz.min() / 20, hertz.max() * 20, 400)
        lines = np.concatenate([(hertz[:, None] + width[:, None] * near).ravel(), wide])
        lines = np.unique(lines[(lines > wide[0]) & (lines < wide[-1])])
        return LobeCurves(lines, self.modes.receptance(lines), mean_matrix(self.cut))


SEMI_STEPS, SEMI_PER_RADIAN = 24, 3.0  # of a period, more per radian of the fastest mode: for 1 %
AVERAGED = 16  # points of a step, over which the directional matrix is averaged


def semi_monodromies(machine: Machine, rpm: float, factor: float) -> Monodromies:
    """By first-order semi-discretisation; `factor` multiplies its steps.

    Over each of m equal steps of a tooth's period the directional matrix is its average and the
    vibration of the tooth before the mean of the step's ends (Insperger and Stépán, Int. J.
    Numerical Methods in Engineering 61, 2004). The error falls with the square of the step. Raises
    InputError where teeth do not follow at equal angles.
    """
    if not machine.cut.even:
        raise InputError(
            "The semi-discretisation knows teeth at equal angles only; choose the method "
            "full_discretisation for pitch_deg."
        )
    angle = machine.fastest * 60 / (rpm * machine.cut.teeth)
    count = int(np.ceil(factor * np.ceil(SEMI_STEPS + SEMI_PER_RADIAN * angle)))
    return lambda depths: [semi_monodromy(machine, rpm, count, float(b)) for b in depths]


def semi_monodromy(machine: Machine, rpm: float, count: int, depth: float) -> np.ndarray:
    """Of `count` steps at a depth in m, over states and (count) displacements before."""
    modes, cut = machine.modes, machine.cut
    tau = 60 / (rpm * cut.teeth)
    # A residual compliance gives way at once: F = bA(Cz + DF − u before) is solved for F.
    rest, force = modes.residual, depth * _step_matrices(machine, count, depth)
    force = np.linalg.solve(np.eye(2) - force @ rest, force)
    real, imag = np.diag(modes.poles.real), np.diag(modes.poles.imag)
    push = np.concatenate([modes.drives.real, modes.drives.imag])
    seen = 2 * np.concatenate([modes.shapes.real, -modes.shapes.imag]).T
    size, forced = len(push), push @ force
    # One exponential of [[A, B], [0, 0]] holds the transition and the integral of the force.
    both = np.zeros((count, size + 2, size + 2))
    both[:, :size, :size] = np.block([[real, -imag], [imag, real]]) + forced @ seen
    both[:, :size, size:] = -forced
    both = expm(both * tau / count)
    state = np.eye(size, size + 2 * count)
    past = [np.eye(2, size + 2 * count, size + 2 * i) for i in range(count)]  # latest first
    for step, pushed in zip(both, force, strict=True):
        before, moved = (past[-1] + past[-2]) / 2, seen @ state
        state = step[:size, :size] @ state + step[:size, size:] @ before
        past = [moved + rest @ pushed @ (moved - before), *past[:-1]]
    return np.concatenate([state, *past])


def _step_matrices(machine: Machine, count: int, depth: float) -> np.ndarray:
    """(count, 2, 2) in N/m² of all teeth, averaged over equal steps of a tooth's period."""
    cut, (start, _) = machine.cut, machine.cut.immersion_rad
    fine = count * AVERAGED
    edges = start + 2 * np.pi / cut.teeth * (np.arange(fine) + 0.5) / fine
    # Every tooth, in this turn and the next: a helix may still cut where its tip has left.
    tips = edges[:, None] + 2 * np.pi / cut.teeth * np.arange(2 * cut.teeth)
    total = tooth_matrix(cut, tips, depth).sum(axis=1)
    return np.mean(np.reshape(total, (count, AVERAGED, 2, 2)), axis=1)


def check_structure(modes: CutterModes) -> None:
    """InputError where the structure is unstable or does not move in the plane of the cut."""
    if not len(modes.poles):
        raise InputError(
            "No mode moves in the plane of the cut; check feed and axis in the cut's file."
        )
    if np.any(modes.poles.real >= 0):
        raise InputError("The structure has a mode without damping; correct its damping ratio.")


def multipliers(matrices: list[np.ndarray]) -> np.ndarray:
    """(B,) complex: of each monodromy the eigenvalue of largest size, imaginary part ≥ 0."""
    every = map(np.linalg.eigvals, matrices)
    top = np.array([values[np.argmax(np.abs(values))] for values in every], complex)
    return top.real + 1j * np.abs(top.imag)


FINER = 1.5  # factor on the points, until they suffice
EXACT = 1e-7  # relative change of |µ| up to which points per period are added


def multiplier(machine: Machine, rpm: float, depth_m: float) -> tuple[float, float]:
    """Largest |µ| over one period (of a tooth, or of a turn where pitches differ), its error.

    At a speed in rpm and a depth in m, with points added until it stays.
    """
    factor, before = FINER, np.inf
    while True:
        built = machine.monodromies(rpm, factor)(np.array([depth_m]))
        size = float(np.abs(multipliers(built)[0]))
        error = abs(size - before)
        # Most chips: points of a period: beyond them eigenvalues take minutes
        if error < EXACT * size or built[0].shape[0] * FINER > 600:
            return size, error
        factor, before = factor * FINER, size
