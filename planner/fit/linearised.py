"""What a misfit is at a point: its columns, its normal equations, and what belongs to poses."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.dynamics.motion import Motion


@dataclass(frozen=True, eq=False)
class Numbers:
    """What is known of numbers x before: mean, precision, bounds, the longest steps, and which are
    stiffnesses that go in compliance."""

    mean: np.ndarray
    precision: np.ndarray
    least: np.ndarray
    most: np.ndarray
    longest: np.ndarray
    compliant: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Point:
    """A misfit at x: half of χ² with the prior's, half of χ²'s slopes and curvature.

    `own` (n, l) are the likeliest numbers of each pose.
    """

    x: np.ndarray
    value: float
    gradient: np.ndarray
    normal: np.ndarray
    own: np.ndarray


@dataclass(frozen=True, eq=False)
class At(Point):
    """A misfit of FRFs at x (the bodies' barrier is in its slopes and curvature).

    `own` were linearised about `about`; `volume` is what eliminating them costs. `precision` is the
    prior's.
    """

    chi2: float
    precision: np.ndarray
    volume: float
    motion: Motion
    about: np.ndarray
    eliminated: "Eliminated | None" = None

    @cached_property
    def covariance(self) -> np.ndarray:
        """(D, D) of x by Laplace's method."""
        return np.linalg.inv(self.normal + self.precision)


@dataclass(frozen=True, eq=False)
class Eliminated:
    """All columns (n, D + l + 1, N) in units of the noise, the residual last.

    `inverses` (n, l, l) of the own numbers' Cholesky factors L, `onto` L⁻¹ times their rows of the
    Gram matrix.
    """

    white: np.ndarray
    inverses: np.ndarray
    onto: np.ndarray


@dataclass(frozen=True, eq=False)
class Around:
    """The model at x: columns (n, D + l + 1, r, c, F) by x and own numbers, the residual last."""

    x: np.ndarray
    accelerance: np.ndarray
    columns: np.ndarray
    motion: Motion
    about: np.ndarray
