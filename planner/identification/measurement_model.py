"""What every measurement leaves open, integrated out: of hits, measuring chain and readback.

A hit along e that misses by δ and lands o beside the tcp is answered, to first order, by
H (e + δ) + M (o × e), M being the response to moments at the tcp. A chain within its tolerance
shows (I + E) (H + turning × p) at iω, delayed. Joints stand beside their readback. All of these are
a few numbers a pose with normal priors, in which the FRF is linear: B η, η ~ N(0, 1). Integrating
over η turns the covariance of the residuals from I into I + B Bᵀ (Woodbury), pose by pose.
"""

from dataclasses import dataclass

import numpy as np

from planner.dynamics.gradient import Turned
from planner.robot.config import RobotConfig

ACROSS = ((1, 2), (2, 0), (0, 1))  # the two directions across each axis, in cyclic order


@dataclass(frozen=True)
class Tolerances:
    """Standard deviations of what a careful hand, a good sensor and a taught pose leave.

    `angle_rad`, `offset_m`: of each of two directions of a hit; `gain`, `cross_axis`,
    `mounting_rad`, `position_m`: of the sensor; `force_gain` of the hammer; `delay_s`; `joint_rad`:
    of each joint's readback.
    """

    angle_rad: float = np.deg2rad(2.0)
    offset_m: float = 0.005
    gain: float = 0.02
    cross_axis: float = 0.03
    mounting_rad: float = np.deg2rad(2.0)
    position_m: float = 0.01
    force_gain: float = 0.03
    delay_s: float = 6e-5
    joint_rad: float = np.deg2rad(0.05)

    @classmethod
    def of(cls, config: RobotConfig) -> "Tolerances":
        """As robot.toml or campaign.toml state them."""
        hits, sensor, readback = config.hits, config.sensor, config.readback
        return cls(
            np.deg2rad(hits.angle_sd_deg), 1e-3 * hits.offset_sd_mm, sensor.gain_sd_percent / 100,
            sensor.cross_axis_sd_percent / 100, np.deg2rad(sensor.mounting_sd_deg),
            1e-3 * sensor.position_sd_mm, sensor.force_gain_sd_percent / 100,
            joint_rad=np.deg2rad(readback.joint_sd_deg),
        )  # fmt: skip

    @property
    def across(self) -> float:
        """Of what a channel shows of another: its sensitivity across, and how the sensor sits."""
        return float(np.hypot(self.cross_axis, self.mounting_rad))


HIT_NUMBERS = 12  # of a pose: 4 of each hit axis
CHAIN_NUMBERS = 14
OPEN = HIT_NUMBERS + CHAIN_NUMBERS  # and one more of each joint


def hit_basis(
    h: np.ndarray, moment: np.ndarray, t: Tolerances, out: np.ndarray | None = None
) -> np.ndarray:
    """Changes (n, 3, 4, 3, F) of the column of each hit axis, per sd of δ (2) and of o (2).

    h (n, 3, 3, F) are accelerances, `moment` (n, 3, 3, F) those of moments.
    """
    n, _, _, lines = h.shape
    out = np.empty((n, 3, 4, 3, lines), dtype=complex) if out is None else out
    for axis, (first, second) in enumerate(ACROSS):
        np.multiply(h[:, :, first], t.angle_rad, out=out[:, axis, 0])
        np.multiply(h[:, :, second], t.angle_rad, out=out[:, axis, 1])
        # e_first × e = −e_second and e_second × e = e_first.
        np.multiply(moment[:, :, second], -t.offset_m, out=out[:, axis, 2])
        np.multiply(moment[:, :, first], t.offset_m, out=out[:, axis, 3])
    return out


def chain_basis(
    h: np.ndarray, turning: np.ndarray, s: np.ndarray, t: Tolerances, out: np.ndarray | None = None
) -> np.ndarray:
    """Changes (n, 14, 3, 3, F) of FRFs per sd: of E (9), the sensor's place (3), scale, delay.

    `out`, where it is given, holds zeros.
    """
    out = np.zeros((h.shape[0], CHAIN_NUMBERS, *h.shape[1:]), dtype=complex) if out is None else out
    for i in range(3):
        for j in range(3):
            np.multiply(h[:, j], t.gain if i == j else t.across, out=out[:, 3 * i + j, i])
    for axis, (first, second) in enumerate(ACROSS):
        # α × e_axis, α being the sensor's angular acceleration.
        np.multiply(turning[:, second], t.position_m, out=out[:, 9 + axis, first])
        np.multiply(turning[:, first], -t.position_m, out=out[:, 9 + axis, second])
    np.multiply(h, t.force_gain, out=out[:, 12])
    np.multiply(h, -t.delay_s * s[:, None, None], out=out[:, 13])
    return out


def basis(h: np.ndarray, turned: Turned, s: np.ndarray, t: Tolerances) -> np.ndarray:
    """All of them of the poses, (n, 26 + dof, 3, 3, F).

    Those of the joints are there where the matrices behind `turned` have their slopes.
    """
    n, _, _, lines = h.shape
    joints = 0 if turned.by_angle is None else turned.by_angle.shape[1]
    # All is written once, in place: such arrays are large.
    out = np.zeros((n, OPEN + joints, 3, 3, lines), dtype=complex)
    by_axis = out[:, :HIT_NUMBERS].reshape(n, 3, 4, 3, 3, lines)
    # A miss along an axis changes the column of that axis only: a view of these.
    hit_basis(h, turned.moment, t, np.einsum("namiaf->namif", by_axis))
    chain_basis(h, turned.turning, s, t, out[:, HIT_NUMBERS:OPEN])
    if turned.by_angle is not None:
        np.multiply(turned.by_angle, t.joint_rad, out=out[:, OPEN:])
    return out


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

    def shown(self, h: np.ndarray, turned: Turned) -> np.ndarray:
        """FRFs (n, 3, 3, F) as the chain shows them."""
        beside = np.cross(np.moveaxis(turned.turning, 1, -1), self.place)
        return self.of_accelerations(h + np.moveaxis(beside, -1, 1))


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


@dataclass(frozen=True, eq=False)
class Integrated:
    """χ² with all η integrated out, in all and of each pose (n,); half gradient, and normal."""

    chi2: float
    gradient: np.ndarray
    normal: np.ndarray
    by_pose: np.ndarray


@dataclass(frozen=True, eq=False)
class Told:
    """Estimates, in sds: `own` (n, 12 + dof) of each pose's hits and joints, `chain` (14,)."""

    own: np.ndarray
    chain: np.ndarray


@dataclass(frozen=True, eq=False)
class LeftOpen:
    """B of n poses, weighted, as it is somewhere and held there.

    `own` (l, m) of each pose is whitened (by `factor`), so that integrating out subtracts the
    square of what is projected on it; `common` (14, m) is of numbers that all poses share: the
    chain of a campaign. `crossed` (n, 3, 3, F), weighted, is what goes beyond first order. Were B
    to follow the parameters, larger FRFs would seem to fit better, having larger B.
    """

    own: tuple[np.ndarray, ...]
    factor: tuple[np.ndarray, ...]
    common: tuple[np.ndarray, ...]
    crossed: np.ndarray

    @classmethod
    def at(
        cls,
        h: np.ndarray,
        turned: Turned,
        s: np.ndarray,
        weight: np.ndarray,
        tolerances: Tolerances,
        told: Told | None = None,
    ) -> "LeftOpen":
        """Of accelerances h (n, 3, 3, F) and the weight of residuals.

        With `told`, what the chain makes of hits that miss, of second order, is that of these
        estimates. (B itself must not follow them: it would then be fitted to the same noise.)
        """
        made = basis(h, turned, s, tolerances)
        crossed = np.zeros_like(h) if told is None else _crossed(made, turned, s, tolerances, told)
        made *= weight[:, None]
        own, factors, common = [], [], []
        for pose in made:
            mine = _real(np.concatenate([pose[:HIT_NUMBERS], pose[OPEN:]]))
            factor = np.linalg.cholesky(np.eye(len(mine)) + mine @ mine.T)
            own.append(np.linalg.solve(factor, mine))
            factors.append(factor)
            common.append(_real(pose[HIT_NUMBERS:OPEN]))
        return cls(tuple(own), tuple(factors), tuple(common), weight * crossed)

    def integrated(self, residual: np.ndarray, slope: np.ndarray) -> Integrated:
        """Of residuals (n, 3, 3, F) and their derivatives (n, d, 3, 3, F), both weighted."""
        residual = residual + self.crossed
        d, k = slope.shape[1], CHAIN_NUMBERS
        chi2, gradients = np.empty(len(residual)), np.empty((len(residual), d + k))
        whole, shared = np.zeros((d + k, d + k)), np.empty((len(residual), k, k))
        for i, (own, common) in enumerate(zip(self.own, self.common, strict=True)):
            r, j = _real(residual[i, None])[0], np.concatenate([_real(slope[i]), common])
            onto, moved = own @ r, own @ j.T
            chi2[i] = r @ r - onto @ onto
            gradients[i] = j @ r - moved.T @ onto
            normal = j @ j.T - moved.T @ moved
            shared[i] = normal[d:, d:]
            whole += normal
        pull = gradients.sum(axis=0)
        # The common numbers at their best, and what that takes from all else.
        right = np.column_stack([pull[d:], whole[d:, :d]])
        solved = np.linalg.solve(whole[d:, d:] + np.eye(k), right)
        eta, across = -solved[:, 0], solved[:, 1:]
        by_pose = chi2 + 2 * gradients[:, d:] @ eta + np.einsum("nij,i,j->n", shared, eta, eta)
        return Integrated(
            float(chi2.sum() + pull[d:] @ eta),
            pull[:d] + whole[:d, d:] @ eta,
            whole[:d, :d] - whole[:d, d:] @ across,
            by_pose,
        )

    def told(self, residual: np.ndarray) -> Told:
        """What weighted residuals (n, 3, 3, F) tell of the numbers."""
        flat = _real(residual + self.crossed)
        whole, pull = np.eye(CHAIN_NUMBERS), np.zeros(CHAIN_NUMBERS)
        for own, common, r in zip(self.own, self.common, flat, strict=True):
            moved = own @ common.T
            whole += common @ common.T - moved.T @ moved
            pull += common @ r - moved.T @ (own @ r)
        chain = -np.linalg.solve(whole, pull)
        left = [
            -np.linalg.solve(factor.T, own @ (r + chain @ common))
            for own, factor, common, r in zip(self.own, self.factor, self.common, flat, strict=True)
        ]
        return Told(np.array(left), chain)


def _crossed(
    made: np.ndarray, turned: Turned, s: np.ndarray, t: Tolerances, told: Told
) -> np.ndarray:
    """Of second order (n, 3, 3, F): what the chain makes of the misses, both as they are told."""
    hits, joints = made[:, :HIT_NUMBERS], made[:, OPEN:]
    missed = np.einsum("nl,nlijf->nijf", told.own[:, :HIT_NUMBERS], hits)
    missed += np.einsum("nl,nlijf->nijf", told.own[:, HIT_NUMBERS:], joints)
    turns = hit_basis(turned.turning, turned.twisting, t)
    numbers = told.own[:, :HIT_NUMBERS].reshape(-1, 3, 4)
    turning = np.einsum("nam,namif->niaf", numbers, turns)
    return np.einsum("k,nkijf->nijf", told.chain, chain_basis(missed, turning, s, t))


def _real(values: np.ndarray) -> np.ndarray:
    """Real and imaginary parts (l, 2 · 9F) of values (l, 3, 3, F)."""
    return np.ascontiguousarray(values).reshape(len(values), -1).view(float)
