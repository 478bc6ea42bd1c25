"""What every measurement leaves open, integrated out: of hits, measuring chain and readback.

A hit along e that misses by δ and lands o beside the tcp is answered, to first order, by
H (e + δ) + M (o × e), M being the response to moments at the tcp. A chain within its tolerance
shows (I + E) (H + turning × p) at iω, delayed. Joints stand beside their readback. All of these are
a few numbers a pose with normal priors, in which the FRF is linear: B η, η ~ N(0, 1). Integrating
over η turns the covariance of the residuals from I into I + B Bᵀ (Woodbury), pose by pose.

FRFs are between points: r rows, three a sensor, and c columns, three a hit point, each in its own
frame. Every sensor has a matrix and a place of its own; the hammer and the delay are common.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

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


OF_HIT, OF_SENSOR, OF_HAMMER = 4, 12, 2  # numbers of each hit axis, each sensor, and of all


@dataclass(frozen=True)
class OpenNumbers:
    """How many numbers FRFs (…, r, c, F) leave open: of hits, then of the chain, then of joints."""

    hits: int
    chain: int

    @classmethod
    def of(cls, h: np.ndarray) -> "OpenNumbers":
        """Of FRFs between some points."""
        rows, columns = h.shape[-3:-1]
        return cls(OF_HIT * columns, OF_SENSOR * (rows // 3) + OF_HAMMER)

    @property
    def known(self) -> int:
        """Of hits and chain: those of the joints follow."""
        return self.hits + self.chain

    def own(self, values: np.ndarray) -> np.ndarray:
        """Of values (l, …) of all numbers those of the pose alone: hits and joints."""
        return np.concatenate([values[: self.hits], values[self.known :]])

    def shared(self, values: np.ndarray) -> np.ndarray:
        """Of values (l, …) those of the chain."""
        return values[self.hits : self.known]


# Of one hit point and one sensor: what is predicted at the tool.
HIT_NUMBERS, CHAIN_NUMBERS = 3 * OF_HIT, OF_SENSOR + OF_HAMMER
OPEN = HIT_NUMBERS + CHAIN_NUMBERS  # and one more of each joint


def hit_basis(
    h: np.ndarray, moment: np.ndarray, t: Tolerances, out: np.ndarray | None = None
) -> np.ndarray:
    """Changes (n, c, 4, r, F) of the column of each hit axis, per sd of δ (2) and of o (2).

    h (n, r, c, F) are accelerances, `moment` (n, r, c, F) those of moments.
    """
    n, rows, columns, lines = h.shape
    out = np.empty((n, columns, OF_HIT, rows, lines), dtype=complex) if out is None else out
    for column in range(columns):
        at = column - column % 3
        first, second = (at + axis for axis in ACROSS[column % 3])
        np.multiply(h[:, :, first], t.angle_rad, out=out[:, column, 0])
        np.multiply(h[:, :, second], t.angle_rad, out=out[:, column, 1])
        # e_first × e = −e_second and e_second × e = e_first.
        np.multiply(moment[:, :, second], -t.offset_m, out=out[:, column, 2])
        np.multiply(moment[:, :, first], t.offset_m, out=out[:, column, 3])
    return out


def chain_basis(
    h: np.ndarray, turning: np.ndarray, s: np.ndarray, t: Tolerances, out: np.ndarray | None = None
) -> np.ndarray:
    """Changes (n, k, r, c, F) of FRFs per sd: of each sensor's E (9) and place (3); scale, delay.

    `out`, where it is given, holds zeros.
    """
    if out is None:
        out = np.zeros((h.shape[0], OpenNumbers.of(h).chain, *h.shape[1:]), dtype=complex)
    for sensor in range(h.shape[1] // 3):
        place, row = OF_SENSOR * sensor, 3 * sensor
        for i in range(3):
            for j in range(3):
                size, to = t.gain if i == j else t.across, out[:, place + 3 * i + j, row + i]
                np.multiply(h[:, row + j], size, out=to)
        for axis, (first, second) in enumerate(ACROSS):
            # α × e_axis, α being the sensor's angular acceleration.
            moved, a, b = out[:, place + 9 + axis], row + first, row + second
            np.multiply(turning[:, b], t.position_m, out=moved[:, a])
            np.multiply(turning[:, a], -t.position_m, out=moved[:, b])
    np.multiply(h, t.force_gain, out=out[:, -2])
    np.multiply(h, -t.delay_s * s[:, None, None], out=out[:, -1])
    return out


def basis(h: np.ndarray, turned: Turned, s: np.ndarray, t: Tolerances) -> np.ndarray:
    """All of them of the poses, (n, l, r, c, F): as `OpenNumbers` counts them.

    Those of the joints are there where the matrices behind `turned` have their slopes.
    """
    n, rows, columns, lines = h.shape
    numbers = OpenNumbers.of(h)
    joints = 0 if turned.by_angle is None else turned.by_angle.shape[1]
    # All is written once, in place: such arrays are large.
    out = np.zeros((n, numbers.known + joints, rows, columns, lines), dtype=complex)
    by_axis = out[:, : numbers.hits].reshape(n, columns, OF_HIT, rows, columns, lines)
    # A miss along an axis changes the column of that axis only: a view of these.
    hit_basis(h, turned.moment, t, np.einsum("namiaf->namif", by_axis))
    chain_basis(h, turned.turning, s, t, out[:, numbers.hits : numbers.known])
    if turned.by_angle is not None:
        np.multiply(turned.by_angle, t.joint_rad, out=out[:, numbers.known :])
    return out


@dataclass(frozen=True, eq=False)
class ChainTransfer:
    """What a chain shows whose numbers are known: `scale` (n, F) times `matrix` (r, r).

    `place` (s, 3) is where each sensor is, in m from where it is said to be.
    """

    matrix: np.ndarray
    scale: np.ndarray
    place: np.ndarray

    @classmethod
    def of(cls, numbers: np.ndarray, s: np.ndarray, t: Tolerances) -> "ChainTransfer":
        """Of all its numbers in sds, in the order of `chain_basis`, at s (n, F) in rad/s."""
        each = numbers[:-OF_HAMMER].reshape(-1, OF_SENSOR)
        within = np.where(np.eye(3), t.gain, t.across) * each[:, :9].reshape(-1, 3, 3)
        matrix = np.asarray(block_diag(*(np.eye(3) + within)))
        scale = (1 + t.force_gain * numbers[-2]) * np.exp(-t.delay_s * numbers[-1] * s)
        return cls(matrix, scale, t.position_m * each[:, 9:])

    def of_accelerations(self, values: np.ndarray) -> np.ndarray:
        """What is shown of accelerations (n, …, r, c, F), those of the responses third to last."""
        lines = values.shape[-1]
        flat = values.reshape(*values.shape[:-2], -1)
        scale = self.scale.reshape(len(self.scale), *[1] * (values.ndim - 2), lines)
        return (self.matrix @ flat).reshape(values.shape) * scale

    def shown(self, h: np.ndarray, turned: Turned) -> np.ndarray:
        """FRFs (n, r, c, F) as the chain shows them."""
        turning = turned.turning.reshape(len(h), len(self.place), 3, *h.shape[2:])
        beside = np.cross(np.moveaxis(turning, 2, -1), self.place[:, None, None])
        return self.of_accelerations(h + np.moveaxis(beside, -1, 2).reshape(h.shape))


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
    """Estimates, in sds: `own` (n, 4c + dof) of each pose's hits and joints, `chain` (k,)."""

    own: np.ndarray
    chain: np.ndarray


@dataclass(frozen=True, eq=False)
class LeftOpen:
    """B of n poses, weighted, as it is somewhere and held there.

    `own` (l, m) of each pose is whitened (by `factor`), so that integrating out subtracts the
    square of what is projected on it; `common` (k, m) is of numbers that all poses share: the
    chain of a campaign. `crossed` (n, r, c, F), weighted, is what goes beyond first order. Were B
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
        """Of accelerances h (n, r, c, F) and the weight of residuals.

        With `told`, what the chain makes of hits that miss, of second order, is that of these
        estimates. (B itself must not follow them: it would then be fitted to the same noise.)
        """
        made = basis(h, turned, s, tolerances)
        crossed = np.zeros_like(h) if told is None else _crossed(made, turned, s, tolerances, told)
        made *= weight[:, None]
        numbers = OpenNumbers.of(h)
        own, factors, common = [], [], []
        for pose in made:
            mine = _real(numbers.own(pose))
            factor = np.linalg.cholesky(np.eye(len(mine)) + mine @ mine.T)
            own.append(np.linalg.solve(factor, mine))
            factors.append(factor)
            common.append(_real(numbers.shared(pose)))
        return cls(tuple(own), tuple(factors), tuple(common), weight * crossed)

    def integrated(self, residual: np.ndarray, slope: np.ndarray) -> Integrated:
        """Of residuals (n, r, c, F) and their derivatives (n, d, r, c, F), both weighted."""
        residual = residual + self.crossed
        d, k = slope.shape[1], len(self.common[0])
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
        """What weighted residuals (n, r, c, F) tell of the numbers."""
        flat, k = _real(residual + self.crossed), len(self.common[0])
        whole, pull = np.eye(k), np.zeros(k)
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
    """Of second order (n, r, c, F): what the chain makes of the misses, both as they are told."""
    count = OpenNumbers.of(made)
    hits, joints = made[:, : count.hits], made[:, count.known :]
    missed = np.einsum("nl,nlijf->nijf", told.own[:, : count.hits], hits)
    missed += np.einsum("nl,nlijf->nijf", told.own[:, count.hits :], joints)
    turns = hit_basis(turned.turning, turned.twisting, t)
    numbers = told.own[:, : count.hits].reshape(len(made), -1, OF_HIT)
    turning = np.einsum("nam,namif->niaf", numbers, turns)
    return np.einsum("k,nkijf->nijf", told.chain, chain_basis(missed, turning, s, t))


def _real(values: np.ndarray) -> np.ndarray:
    """Real and imaginary parts (l, 2rcF) of values (l, r, c, F)."""
    return np.ascontiguousarray(values).reshape(len(values), -1).view(float)
