"""Busch et al. 2020 as published: GP, NARGP and MFDGP of the amplitude over (frequency, angle).

The amplitude itself is modelled, in m/s²/N, over x = (f, φ) (section 3 there): GP with RBF kernel
(eq. 7) of the measured points alone; NARGP and MFDGP of both levels. The cheap level of NARGP is an
exact GP of the whole simulated grid, which is what a GP of its 12,801 points is. What differs: GP
has the data's mean where the paper adds a bias kernel; there is a length scale for f and one for φ,
as Perdikaris et al. have it, where eqs. 6 and 7 show one; MFDGP has fewer inducing points and steps
than the paper's 800 and 35,000, and a larger rate in the second stage (`Training`). Not as
published, the logarithm of the amplitude, which stays positive, may be modelled instead.

On a grid cov = k_a(a, a') k_b(b, b') + noise: two small eigendecompositions (Kronecker structure,
Saatçi 2011, chapter 5) do what a Cholesky factor of ten thousand points could not. Hyperparameters
are the most probable ones, for thousands of points leave little doubt about them.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.errors import InputError
from planner.surrogate.kernels import parse, perdikaris
from planner.surrogate.likelihood import maximise
from planner.surrogate.models.likelihood_gp import (
    NARGP,
    FidelityLevel,
    Normalisation,
    Samples,
    fit_growing,
    widened,
)
from planner.surrogate.models.mfdgp import Training, fit_mfdgp
from planner.surrogate.models.multitask import KroneckerSolution, pull, solve_kronecker

SURFACES = "GP", "NARGP", "MFDGP"
# NARGP's climb begins with so many of the measured points, which costs next to nothing, goes on
# with more, and ends with all.
SOME_POINTS, STARTS = (250, 900), 32
SURFACE_TRAINING = Training(4000, 4000, inducing=200)
NOISE, NOISE_SPREAD = 0.03, 2.0  # median sd of the noise over the output's, its log-sd
LENGTH, LENGTH_SPREAD = 0.3, 1.5  # of the scales, and of the amplitude's logarithm
SHORT = -1.5  # sds of the prior by which the second start's length scales are shorter
REACH = 5.0  # sds of the prior beyond which nothing is looked for
JITTER = 1e-9  # added to the covariances' diagonals
RBF = parse("rbf", 1)  # of either axis


@dataclass(frozen=True, eq=False)
class GridGP:
    """Fitted; θ of both axes' RBF kernels, the noise in the nugget's place of `theta_a`."""

    a: np.ndarray  # (n, 1)
    b: np.ndarray  # (t, 1)
    theta_a: np.ndarray
    theta_b: np.ndarray
    solved: KroneckerSolution
    units: Normalisation

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q,) of the noise-free output at x (q, 2) = (a, b)."""
        cross_a = RBF.covariance(np, self.theta_a, x[:, :1], self.a)
        cross_b = RBF.covariance(np, self.theta_b, x[:, 1:], self.b)
        mean = np.einsum("qi,it,qt->q", cross_a, self.solved.alpha, cross_b, optimize="optimal")
        v, w, u = self.solved.rotation
        explained = np.einsum(
            "qi,it,qt->q", (cross_a @ v) ** 2, 1 / w, (cross_b @ u) ** 2, optimize="optimal"
        )
        own = RBF.variance(np, self.theta_a, x[:, :1]) * RBF.variance(np, self.theta_b, x[:, 1:])
        return self.units.restored(mean, np.sqrt(np.maximum(own - explained, 0.0)))


def fit_grid(a: np.ndarray, b: np.ndarray, y: np.ndarray) -> GridGP:
    """GP of y (n, t) over a (n,) by b (t,), each scaled to about [0, 1], without gaps."""
    a, b, units = a[:, None], b[:, None], Normalisation.of(y.reshape(-1))
    prior = RBF.prior(1.0, NOISE, LENGTH, LENGTH_SPREAD, LENGTH_SPREAD)
    mean, width = (np.tile(part, 2) for part in prior)
    width[1] = NOISE_SPREAD  # the nugget's place in θ_a holds the noise
    width[RBF.size : RBF.size + 2] = 1e-6  # θ_b's amplitude and nugget: θ_a's are enough

    def solve(z: np.ndarray) -> tuple[KroneckerSolution, np.ndarray, np.ndarray]:
        theta_a, theta_b = np.split(mean + width * z, 2)
        ka, kb = (
            RBF.covariance(np, theta, p, p) + JITTER * np.eye(len(p))
            for theta, p in ((theta_a, a), (theta_b, b))
        )
        noise = np.full(len(b), np.exp(2 * theta_a[1]))
        return solve_kronecker(units.normalised(y), ka, kb, noise), theta_a, theta_b

    def posterior(z: np.ndarray) -> tuple[float, np.ndarray]:
        solved, theta_a, theta_b = solve(z)
        slope_a = np.array(pull("rbf", theta_a, a, solved.slope_k))
        slope_b = np.array(pull("rbf", theta_b, b, solved.slope_b))
        slope_a[1] += np.sum(solved.slope_log_noise)
        slope = np.concatenate([slope_a, slope_b]) * width
        return solved.value - 0.5 * float(z @ z), slope - z

    starts = np.zeros((2, len(mean)))
    starts[1, 2 : RBF.size] = starts[1, RBF.size + 2 :] = SHORT
    solved, theta_a, theta_b = solve(maximise(posterior, list(starts), -REACH, REACH).x)
    return GridGP(a, b, theta_a, theta_b, solved, units)


@dataclass(frozen=True, eq=False)
class Grid:
    """Amplitude (f, p) in m/s²/N at frequency_hz (f,) by pose (p,), in any unit."""

    frequency_hz: np.ndarray
    pose: np.ndarray
    amplitude: np.ndarray

    def scaled(self, origin: np.ndarray, extent: np.ndarray) -> "Grid":
        """Frequency and pose less their `origin` (2,), over their `extent` (2,)."""
        lines = (self.frequency_hz - origin[0]) / extent[0]
        return Grid(lines, (self.pose - origin[1]) / extent[1], self.amplitude)

    @property
    def points(self) -> np.ndarray:
        """All pairs (f·p, 2) of frequency and pose."""
        f, p = len(self.frequency_hz), len(self.pose)
        return np.column_stack([np.repeat(self.frequency_hz, p), np.tile(self.pose, f)])


@dataclass(frozen=True, eq=False)
class Surface:
    """Fitted; `model` gives the amplitude, or its `logarithm`, over scaled coordinates, 0 to 1."""

    model: FidelityLevel
    origin: np.ndarray
    extent: np.ndarray
    logarithm: bool = False

    def predict(self, frequency_hz: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean amplitude and its sd (f, p) in m/s²/N; the mean may be negative, as published.

        Of the logarithm: median amplitude, and the logarithm's sd.
        """
        asked = Grid(frequency_hz, pose, np.empty(0)).scaled(self.origin, self.extent)
        mean, sd = self.model.predict(asked.points)
        shape = len(frequency_hz), len(pose)
        return (np.exp(mean) if self.logarithm else mean).reshape(shape), sd.reshape(shape)


def fit_surface(
    measured: Grid,
    simulated: Grid,
    model: str,
    training: Training = SURFACE_TRAINING,
    logarithm: bool = False,
) -> Surface:
    """Fit one of SURFACES; `training` is MFDGP's.

    InputError for another name, and for amplitudes that are not positive.
    """
    if model not in SURFACES:
        raise InputError(f"No model {model!r} of an FRF surface: use one of {', '.join(SURFACES)}.")
    for grid in (measured, simulated):
        if not (grid.amplitude > 0).all():
            raise InputError("An amplitude is missing or not positive: leave its line out.")
    points = np.vstack([measured.points, simulated.points])
    origin, extent = points.min(axis=0), np.ptp(points, axis=0)
    extent = np.where(extent > 0, extent, 1.0)
    seen, low = (grid.scaled(origin, extent) for grid in (measured, simulated))
    if logarithm:
        seen, low = (replace(grid, amplitude=np.log(grid.amplitude)) for grid in (seen, low))
    return Surface(_fitted(model, seen, low, training), origin, extent, logarithm)


def _fitted(model: str, measured: Grid, simulated: Grid, training: Training) -> FidelityLevel:
    if model == "GP":
        return fit_grid(*vars(measured).values())
    seen, cheap = (Samples.of(g.points, g.amplitude.ravel()) for g in (measured, simulated))
    if model == "MFDGP":
        return fit_mfdgp(cheap, seen, training)
    low = fit_grid(*vars(simulated).values())
    units = Normalisation.of(cheap.y)
    wide = Samples(widened(seen.x, low.predict(seen.x)[0], units), seen.y, seen.sd)
    return NARGP(low, fit_growing(wide, SOME_POINTS, perdikaris(2), STARTS), units)
