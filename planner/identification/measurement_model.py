"""What every measurement leaves open, integrated out: misses of hits, tolerance of the chain.

A hit along e that misses by δ and lands o beside the tcp is answered, to first order, by
H (e + δ) + M (o × e), M being the response to moments at the tcp. A chain within its tolerance
shows (I + E) (H + turning × p) at iω, delayed. All of these are a few numbers a pose with normal
priors, in which the FRF is linear: B η, η ~ N(0, 1). Integrating over η turns the covariance of
the residuals from I into I + B Bᵀ (Woodbury), pose by pose.
"""

from dataclasses import dataclass

import numpy as np

from planner.dynamics.gradient import Turned
from planner.robot.config import HitsTable, SensorTable

ACROSS = ((1, 2), (2, 0), (0, 1))  # the two directions across each axis, in cyclic order


@dataclass(frozen=True)
class Tolerances:
    """Standard deviations of what a careful hand, a good sensor and a taught pose leave.

    `angle_rad`, `offset_m`: of each of two directions of a hit; `gain`, `cross_axis`,
    `mounting_rad`, `position_m`: of the sensor; `force_gain` of the hammer; `delay_s`.
    """

    angle_rad: float = np.deg2rad(2.0)
    offset_m: float = 0.005
    gain: float = 0.02
    cross_axis: float = 0.03
    mounting_rad: float = np.deg2rad(2.0)
    position_m: float = 0.01
    force_gain: float = 0.03
    delay_s: float = 6e-5

    @classmethod
    def of(cls, hits: HitsTable, sensor: SensorTable) -> "Tolerances":
        """As robot.toml or campaign.toml state them."""
        return cls(
            np.deg2rad(hits.angle_sd_deg), 1e-3 * hits.offset_sd_mm, sensor.gain_sd_percent / 100,
            sensor.cross_axis_sd_percent / 100, np.deg2rad(sensor.mounting_sd_deg),
            1e-3 * sensor.position_sd_mm,
        )  # fmt: skip

    @property
    def across(self) -> float:
        """Of what a channel shows of another: its sensitivity across, and how the sensor sits."""
        return float(np.hypot(self.cross_axis, self.mounting_rad))


HIT_COLUMNS = 12  # open numbers of a pose's hits, 4 of each axis; those of the chain follow
CHAIN_COLUMNS = 14
OPEN = HIT_COLUMNS + CHAIN_COLUMNS  # numbers that a pose leaves open


def hit_basis(h: np.ndarray, moment: np.ndarray, t: Tolerances) -> np.ndarray:
    """Changes (n, 3, 4, 3, F) of the column of each hit axis, per sd of δ (2) and of o (2).

    h (n, 3, 3, F) are accelerances, `moment` (n, 3, 3, F) those of moments.
    """
    n, _, _, lines = h.shape
    out = np.empty((n, 3, 4, 3, lines), dtype=complex)
    for axis, (first, second) in enumerate(ACROSS):
        out[:, axis, 0] = t.angle_rad * h[:, :, first]
        out[:, axis, 1] = t.angle_rad * h[:, :, second]
        # e_first × e = −e_second and e_second × e = e_first.
        out[:, axis, 2] = -t.offset_m * moment[:, :, second]
        out[:, axis, 3] = t.offset_m * moment[:, :, first]
    return out


def chain_basis(h: np.ndarray, turning: np.ndarray, s: np.ndarray, t: Tolerances) -> np.ndarray:
    """Changes (n, 14, 3, 3, F) of FRFs per sd: of E (9), the sensor's place (3), scale, delay."""
    out = np.zeros((h.shape[0], 14, *h.shape[1:]), dtype=complex)
    for i in range(3):
        for j in range(3):
            out[:, 3 * i + j, i] = (t.gain if i == j else t.across) * h[:, j]
    for axis, (first, second) in enumerate(ACROSS):
        # α × e_axis, α being the sensor's angular acceleration.
        out[:, 9 + axis, first] = t.position_m * turning[:, second]
        out[:, 9 + axis, second] = -t.position_m * turning[:, first]
    out[:, 12] = t.force_gain * h
    out[:, 13] = -t.delay_s * s[:, None, None] * h
    return out


def basis(h: np.ndarray, turned: Turned, s: np.ndarray, t: Tolerances) -> np.ndarray:
    """All of them of the poses, (n, 26, 3, 3, F)."""
    n, _, _, lines = h.shape
    hits = np.zeros((n, HIT_COLUMNS, 3, 3, lines), dtype=complex)
    for axis, columns in enumerate(np.moveaxis(hit_basis(h, turned.moment, t), 1, 0)):
        hits[:, 4 * axis : 4 * axis + 4, :, axis] = columns
    return np.concatenate([hits, chain_basis(h, turned.turning, s, t)], axis=1)


@dataclass(frozen=True, eq=False)
class ChainTransfer:
    """What a chain shows whose numbers are known: `scale` (n, F) times `matrix` (3, 3).

    `place` (3,) is where the sensor is, in m from where it is said to be.
    """

    matrix: np.ndarray
    scale: np.ndarray
    place: np.ndarray

    @classmethod
    def of(cls, numbers: np.ndarray, s: np.ndarray, t: Tolerances) -> "ChainTransfer":
        """Of 14 numbers in sds, in the order of `chain_basis`, at s (n, F) in rad/s."""
        matrix = np.eye(3) + np.where(np.eye(3), t.gain, t.across) * numbers[:9].reshape(3, 3)
        scale = (1 + t.force_gain * numbers[12]) * np.exp(-t.delay_s * numbers[13] * s)
        return cls(matrix, scale, t.position_m * numbers[9:12])

    def of_accelerations(self, values: np.ndarray) -> np.ndarray:
        """What is shown of accelerations (n, …, 3, 3, F), those of the responses third to last."""
        lines = values.shape[-1]
        flat = values.reshape(*values.shape[:-2], 3 * lines)
        scale = self.scale.reshape(len(self.scale), *[1] * (values.ndim - 2), lines)
        return (self.matrix @ flat).reshape(values.shape) * scale

    def shown(self, h: np.ndarray, turned: Turned) -> tuple[np.ndarray, Turned]:
        """FRFs (n, 3, 3, F) as the chain shows them, and what goes with them."""
        beside = np.cross(np.moveaxis(turned.turning, 1, -1), self.place)
        whole = self.of_accelerations(h + np.moveaxis(beside, -1, 1))
        return whole, Turned(*map(self.of_accelerations, (turned.moment, turned.turning)))


@dataclass(frozen=True, eq=False)
class Marginal:
    """A pose's misfit with η integrated out: χ², half gradient, normal, ln|I + BᵀB|, and E[η]."""

    chi2: float
    gradient: np.ndarray
    normal: np.ndarray
    log_volume: float
    eta: np.ndarray


def marginal(residual: np.ndarray, jacobian: np.ndarray, b: np.ndarray) -> Marginal:
    """Of residuals (m,) with unit noise, their derivatives (d, m) and B (l, m)."""
    inner = np.eye(len(b)) + b @ b.T
    factor = np.linalg.cholesky(inner)
    onto = np.linalg.solve(factor, b @ np.concatenate([residual[None], jacobian]).T)
    r, j = onto[:, 0], onto[:, 1:]
    return Marginal(
        float(residual @ residual - r @ r),
        jacobian @ residual - j.T @ r,
        jacobian @ jacobian.T - j.T @ j,
        2 * float(np.sum(np.log(np.diagonal(factor)))),
        np.linalg.solve(factor.T, r),
    )
