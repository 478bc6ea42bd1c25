"""Busch et al. 2020 as published: GP, NARGP and MFDGP of the amplitude over (frequency, angle).

The amplitude itself is modelled, in m/s²/N, over x = (f, φ) (section 3 there): GP with RBF kernel
(eq. 7) of the measured points alone; NARGP (`nargp`) and MFDGP (`mfdgp`) of both levels. The
cheap level of NARGP is an exact GP of the whole simulated grid (`grid_gp`), which is what a GP of
its 12,801 points is. What differs: GP has the data's mean where the paper adds a bias kernel; there
is a length scale for f and one for φ, as Perdikaris et al. have it, where eqs. 6 and 7 show one;
MFDGP has fewer inducing points and steps than the paper's 800 and 35,000, and a larger rate in the
second stage (`Training`). Not as published, the logarithm of the amplitude, which stays positive,
may be modelled instead.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from planner.errors import InputError
from planner.surrogate.models.fidelity_levels import FidelityLevel, Samples
from planner.surrogate.models.grid_gp import GridGP, fit_grid
from planner.surrogate.models.likelihood_gp import Normalisation, fit_growing
from planner.surrogate.models.mfdgp import Training, fit_mfdgp
from planner.surrogate.models.nargp import NARGP, perdikaris, widened

# NARGP's climb begins with so many of the measured points, which costs next to nothing, goes on
# with more, and ends with all.
SOME_POINTS, STARTS = (250, 900), 32
SURFACE_TRAINING = Training(4000, 4000, inducing=200)


@dataclass(frozen=True, eq=False)
class Grid:
    """Amplitude (f, p) in m/s²/N at frequency_hz (f,) by pose (p,), in any unit."""

    frequency_hz: np.ndarray
    pose: np.ndarray
    amplitude: np.ndarray


@dataclass(frozen=True, eq=False)
class Frame:
    """Frequency and pose as the models want them, 0 to 1."""

    origin: np.ndarray
    extent: np.ndarray

    def axes(self, frequency_hz: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Scaled lines (f,) and poses (p,)."""
        a, b = (
            (v - o) / e
            for v, o, e in zip((frequency_hz, pose), self.origin, self.extent, strict=True)
        )
        return a, b

    def points(self, frequency_hz: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """All pairs (f·p, 2) of them."""
        a, b = self.axes(frequency_hz, pose)
        return np.column_stack([np.repeat(a, len(b)), np.tile(b, len(a))])


@dataclass(frozen=True, eq=False)
class Surface:
    """Fitted; `model` gives the amplitude, or its `logarithm`, over scaled coordinates."""

    model: FidelityLevel
    frame: Frame
    logarithm: bool = False

    def predict(self, frequency_hz: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean amplitude and its sd (f, p) in m/s²/N; the mean may be negative, as published.

        Of the logarithm: median amplitude, and the logarithm's sd.
        """
        mean, sd = self.model.predict(self.frame.points(frequency_hz, pose))
        shape = len(frequency_hz), len(pose)
        return (np.exp(mean) if self.logarithm else mean).reshape(shape), sd.reshape(shape)


def frame_of(measured: Grid, simulated: Grid) -> Frame:
    """The frame that holds both; InputError for amplitudes that are not positive."""
    for grid in (measured, simulated):
        if not (grid.amplitude > 0).all():
            raise InputError("An amplitude is missing or not positive: leave its line out.")
    lines = np.concatenate([measured.frequency_hz, simulated.frequency_hz])
    poses = np.concatenate([measured.pose, simulated.pose])
    extent = np.array([np.ptp(lines), np.ptp(poses)])
    return Frame(np.array([lines.min(), poses.min()]), np.where(extent > 0, extent, 1.0))


def fit_surface(
    measured: Grid,
    simulated: Grid,
    model: str,
    training: Training = SURFACE_TRAINING,
    logarithm: bool = False,
) -> Surface:
    """Fit one of SURFACES; `training` is MFDGP's. InputError for another name."""
    if model not in SURFACES:
        raise InputError(f"No model {model!r} of an FRF surface: use one of {', '.join(SURFACES)}.")
    frame = frame_of(measured, simulated)
    if logarithm:
        measured, simulated = (
            replace(grid, amplitude=np.log(grid.amplitude)) for grid in (measured, simulated)
        )
    return Surface(SURFACES[model](frame, measured, simulated, training), frame, logarithm)


def _samples(frame: Frame, grid: Grid) -> Samples:
    return Samples.of(frame.points(grid.frequency_hz, grid.pose), grid.amplitude.ravel())


def _grid(frame: Frame, grid: Grid) -> GridGP:
    return fit_grid(*frame.axes(grid.frequency_hz, grid.pose), grid.amplitude)


def _gp(frame: Frame, measured: Grid, simulated: Grid, training: Training) -> GridGP:
    return _grid(frame, measured)


def _nargp(frame: Frame, measured: Grid, simulated: Grid, training: Training) -> NARGP:
    low, s = _grid(frame, simulated), _samples(frame, measured)
    units = Normalisation.of(simulated.amplitude.ravel())
    wide = Samples(widened(s.x, low.predict(s.x)[0], units), s.y, s.sd)
    return NARGP(low, fit_growing(wide, SOME_POINTS, perdikaris(2), STARTS), units)


def _mfdgp(frame: Frame, measured: Grid, simulated: Grid, training: Training) -> FidelityLevel:
    return fit_mfdgp(_samples(frame, simulated), _samples(frame, measured), training)


SURFACES: dict[str, Callable[[Frame, Grid, Grid, Training], FidelityLevel]] = {
    "GP": _gp,
    "NARGP": _nargp,
    "MFDGP": _mfdgp,
}
