"""FRF-level fusion of the logarithm of the amplitude over (frequency, pose coordinate).

Not as published: Busch et al. 2020 model the amplitude itself (`published_surface`); its logarithm
stays positive. The simulated surface is a complete grid (`grid_gp`). The measured surface ignores
it (log GP), adds a discrepancy to it (log AR1), is a smooth function of it (log sparse NARGP) or of
its distribution (log quadrature MFDGP). None of them extrapolates well over the pose where
resonances move: a peak that moves is, to a surface, one that ends and another that begins. Fusing
the modes (`planner.surrogate`) does.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.errors import InputError
from planner.surrogate.models.fidelity_levels import FidelityLevel, Samples
from planner.surrogate.models.grid_gp import GridGP, fit_grid
from planner.surrogate.models.nargp import perdikaris
from planner.surrogate.models.quadrature_mfdgp import QuadratureMFDGP, fit_quadrature_mfdgp
from planner.surrogate.models.sparse_gp import SparseGP, fit_sparse

INDUCING = 300  # points of the sparse models, of 2,622


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
    """Fitted; `model` gives the log amplitude over scaled coordinates."""

    model: FidelityLevel
    frame: Frame

    def predict(self, frequency_hz: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Median amplitude and sd of its logarithm (f, p) in m/s²/N."""
        mean, sd = self.model.predict(self.frame.points(frequency_hz, pose))
        shape = len(frequency_hz), len(pose)
        return np.exp(mean).reshape(shape), sd.reshape(shape)


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """AR1 over a surface: y = ρ·y_L + b + δ, ρ and b by least squares."""

    low: GridGP
    delta: GridGP
    slope: float

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q,) of the log amplitude at x (q, 2)."""
        (low, low_sd), (mean, sd) = self.low.predict(x), self.delta.predict(x)
        return self.slope * low + mean, np.hypot(sd, self.slope * low_sd)


@dataclass(frozen=True, eq=False)
class Bent:
    """NARGP over a surface, but sparse: a sparse GP of (x, y_L(x)), priors on its kernel."""

    low: GridGP
    high: SparseGP

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q,) of the log amplitude at x (q, 2)."""
        return self.high.predict(np.column_stack([x, self.low.predict(x)[0]]))


def frame_of(measured: Grid, simulated: Grid) -> Frame:
    """The frame that holds both; InputError for amplitudes that are not positive."""
    for grid in (measured, simulated):
        if not (grid.amplitude > 0).all():
            raise InputError("An amplitude is missing or not positive: leave its line out.")
    lines = np.concatenate([measured.frequency_hz, simulated.frequency_hz])
    poses = np.concatenate([measured.pose, simulated.pose])
    extent = np.array([np.ptp(lines), np.ptp(poses)])
    return Frame(np.array([lines.min(), poses.min()]), np.where(extent > 0, extent, 1.0))


def fit_surface(measured: Grid, simulated: Grid, model: str = "log AR1") -> Surface:
    """Fit one of SURFACES; InputError for another name, or amplitudes that are not positive."""
    if model not in SURFACES:
        raise InputError(f"No model {model!r} of an FRF surface: use one of {', '.join(SURFACES)}.")
    frame = frame_of(measured, simulated)
    return Surface(SURFACES[model](frame, measured, simulated), frame)


def _grid(frame: Frame, grid: Grid, y: np.ndarray) -> GridGP:
    return fit_grid(*frame.axes(grid.frequency_hz, grid.pose), y, ("matern52", "rbf"))


def _samples(frame: Frame, grid: Grid) -> Samples:
    return Samples.of(frame.points(grid.frequency_hz, grid.pose), np.log(grid.amplitude).ravel())


def _gp(frame: Frame, measured: Grid, simulated: Grid) -> GridGP:
    return _grid(frame, measured, np.log(measured.amplitude))


def _ar1(frame: Frame, measured: Grid, simulated: Grid) -> Discrepancy:
    low = _grid(frame, simulated, np.log(simulated.amplitude))
    s = _samples(frame, measured)
    base = low.predict(s.x)[0]
    apart = base - base.mean()
    slope = float(apart @ s.y / max(float(apart @ apart), 1e-300))
    return Discrepancy(
        low, _grid(frame, measured, (s.y - slope * base).reshape(measured.amplitude.shape)), slope
    )


def _nargp(frame: Frame, measured: Grid, simulated: Grid) -> Bent:
    low = _grid(frame, simulated, np.log(simulated.amplitude))
    s = _samples(frame, measured)
    wide = np.column_stack([s.x, low.predict(s.x)[0]])
    return Bent(low, fit_sparse(Samples(wide, s.y, s.sd), perdikaris(2), INDUCING))


def _mfdgp(frame: Frame, measured: Grid, simulated: Grid) -> QuadratureMFDGP:
    low = _grid(frame, simulated, np.log(simulated.amplitude))
    return fit_quadrature_mfdgp(_samples(frame, measured), low, INDUCING)


SURFACES: dict[str, Callable[[Frame, Grid, Grid], FidelityLevel]] = {
    "log GP": _gp,
    "log AR1": _ar1,
    "log sparse NARGP": _nargp,
    "log quadrature MFDGP": _mfdgp,
}
