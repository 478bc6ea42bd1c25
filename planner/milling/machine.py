"""A structure at the cutter and a cut: what every question about stability is asked of."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.errors import InputError
from planner.milling.cut import Cut
from planner.milling.cutter_modes import CutterModes
from planner.milling.directional import Coefficients, mean_matrix
from planner.milling.period import Discretisation, Period, period
from planner.milling.zeroth_order import LobeCurves, curves

Monodromies = Callable[[np.ndarray], list[np.ndarray]]  # of depths (B,) in m

# Points of a period, and more of them per radian of the fastest mode: depths of one-mode cuts are
# then within 1e-4.
POINTS, PER_RADIAN = 8, 0.55
MOST_DEGREE = 32
MOST_POINTS = 400  # of a period: with more, each depth takes a second


@dataclass(frozen=True, eq=False)
class Machine:
    """Modes in the plane of the cut, the cut, and the coefficients that hold."""

    modes: CutterModes
    cut: Cut
    coefficients: Coefficients

    def grid(self, rpm: float, factor: float = 1.0) -> Discretisation:
        """As fine as the fastest mode asks for at this speed, times a factor."""
        start, end = self.cut.immersion_rad
        arc = min(end - start, 2 * np.pi / self.cut.teeth)
        points = factor * (POINTS + PER_RADIAN * self.fastest * arc / (rpm * 2 * np.pi / 60))
        if points > factor * MOST_POINTS:
            slowest = rpm * points / (factor * MOST_POINTS)
            raise InputError(
                f"At {rpm:g} rpm the fastest mode swings too often while a tooth cuts; ask for "
                f'{slowest:.0f} rpm or more, or choose the method "zeroth_order".'
            )
        elements = int(np.ceil(points / MOST_DEGREE))
        return Discretisation(int(np.ceil(points / elements)), arc / elements * (1 + 1e-9))

    @property
    def fastest(self) -> float:
        """The highest pole's size in rad/s."""
        return float(np.max(np.abs(self.modes.poles)))

    def period(self, rpm: float, grid: Discretisation, depth_m: float) -> Period:
        """Matrices of a period; `depth_m` matters with a helix only."""
        return period(self.modes, self.cut, self.coefficients, rpm, grid, depth_m)

    def monodromies(self, rpm: float, factor: float = 1.0) -> Monodromies:
        """By full discretisation, with so many times the usual points."""
        grid = self.grid(rpm, factor)
        if self.cut.lag_rad_m == 0:
            built = self.period(rpm, grid, 0.0)
            return lambda depths: list(built.monodromy(depths))
        return lambda depths: [
            self.period(rpm, grid, float(b)).monodromy(np.array([b]))[0] for b in depths
        ]

    def floor(self) -> LobeCurves:
        """Zeroth-order curves over lines that resolve every mode."""
        mean = mean_matrix(self.cut, self.coefficients)
        lines = resolving_lines(self.modes)
        return curves(lines, self.modes.receptance(lines), mean)


def resolving_lines(modes: CutterModes) -> np.ndarray:
    """(F,) Hz: dense about each mode within its half-power band, and between."""
    hertz, width = np.abs(modes.poles) / (2 * np.pi), -modes.poles.real / (2 * np.pi)
    near = np.sinh(np.linspace(-9, 9, 241)) / 4  # half-widths: steps grow away from the mode
    lines = (hertz[:, None] + width[:, None] * near).ravel()
    wide = np.geomspace(hertz.min() / 20, hertz.max() * 20, 400)
    lines = np.concatenate([lines, wide])
    return np.unique(lines[(lines > wide[0]) & (lines < wide[-1])])


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
    found = np.empty(len(matrices), complex)
    for size in {m.shape for m in matrices}:
        which = [i for i, m in enumerate(matrices) if m.shape == size]
        values = np.linalg.eigvals(np.array([matrices[i] for i in which]))
        top = values[np.arange(len(which)), np.argmax(np.abs(values), axis=1)]
        found[which] = top.real + 1j * np.abs(top.imag)
    return found


FINER = 1.5  # factor on the points, until they suffice
EXACT = 1e-7  # relative change of |µ| up to which points per period are added
MOST_CHIPS = 600  # points of a period: beyond them eigenvalues take minutes


@dataclass(frozen=True)
class Multiplier:
    """Largest |µ| over one period (of a tooth, or of a turn where pitches differ), its error."""

    size: float
    error: float


def multiplier(machine: Machine, rpm: float, depth_m: float) -> Multiplier:
    """At a speed in rpm and a depth in m, with points added until it stays."""
    factor, before = FINER, np.inf
    while True:
        built = machine.monodromies(rpm, factor)(np.array([depth_m]))
        size = float(np.abs(multipliers(built)[0]))
        error = abs(size - before)
        if error < EXACT * size or built[0].shape[0] * FINER > MOST_CHIPS:
            return Multiplier(size, error)
        factor, before = factor * FINER, size
