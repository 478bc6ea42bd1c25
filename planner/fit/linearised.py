"""What a misfit is at a point: its columns, its normal equations, and what belongs to poses."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.dynamics.motion import Motion


@dataclass(frozen=True, eq=False)
class At:
    """A misfit at x: χ², half its gradient and the normal of the data (the bodies' barrier in it).

    `own` (n, l) are the likeliest numbers of each pose, `volume` what eliminating them costs.
    `precision` is the prior's.
    """

    x: np.ndarray
    chi2: float
    gradient: np.ndarray
    normal: np.ndarray
    precision: np.ndarray
    volume: float
    value: float
    own: np.ndarray
    motion: Motion
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
