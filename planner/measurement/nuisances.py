"""What every measurement leaves open, integrated out: of hits, measuring chain and readback.

A hit along e that misses by δ and lands o beside the tcp is answered, to first order, by
H (e + δ) + M (o × e), M being the response to moments at the tcp. A chain within its tolerance
shows (I + E) (H + turning × p) at iω, delayed. Joints stand beside their readback. All of these are
a few numbers a pose with normal priors, in which the FRF is linear: B η, η ~ N(0, 1). Integrating
over η turns the covariance of the residuals from I into I + B Bᵀ (Woodbury), pose by pose.

FRFs are between points: r rows, three a sensor, and c columns, three a hit point, each in its own
frame. Every sensor has a matrix and a place of its own; the hammer and the delay are common.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.dynamics.motion import ActualPorts, Motion
from planner.robot.config import HitsTable, ReadbackTable, RobotConfig, SensorTable

ACROSS = ((1, 2), (2, 0), (0, 1))  # the two directions across each axis, in cyclic order

# An aim beside the point, common to all hits along an axis, in units of a hit's own scatter.
AIM = 0.5
_HITS, _SENSOR = HitsTable(), SensorTable()  # what they are where robot.toml says nothing


@dataclass(frozen=True)
class Tolerances:
    """Standard deviations of what a careful hand, a good sensor and a taught pose leave.

    `angle_rad`, `offset_m`: of each of two directions of a hit; `gain`, `cross_axis`,
    `mounting_rad`, `position_m`: of the sensor; `force_gain` of the hammer; `delay_s`; `joint_rad`:
    of each joint's readback, (dof,) where some are of joints that slide (m); `visit_stiffness` of
    ln k of each spring from visit to visit, as temperature and preload go, `visit_damping` of ln c
    beside it: damping ratios of robots scatter by some ten percent. `visit_chain`: how much
    of what sensor and hammer's gain may be off is a visit's own, as a sensor is seated again and a
    hammer's tip changed.
    """

    angle_rad: float = np.deg2rad(_HITS.angle_sd_deg)
    offset_m: float = 1e-3 * _HITS.offset_sd_mm
    gain: float = _SENSOR.gain_sd_percent / 100
    cross_axis: float = _SENSOR.cross_axis_sd_percent / 100
    mounting_rad: float = np.deg2rad(_SENSOR.mounting_sd_deg)
    position_m: float = 1e-3 * _SENSOR.position_sd_mm
    force_gain: float = _SENSOR.force_gain_sd_percent / 100
    delay_s: float = 6e-5
    joint_rad: float | tuple[float, ...] = np.deg2rad(ReadbackTable().joint_sd_deg)
    visit_stiffness: float = 0.004
    visit_damping: float = 0.1
    visit_chain: float = 0.1

    @classmethod
    def of(cls, config: RobotConfig, slides: Sequence[bool] = ()) -> "Tolerances":
        """As robot.toml or campaign.toml state them; `slides` says which joints do."""
        hits, sensor, readback = config.hits, config.sensor, config.readback
        turns, shifts = float(np.deg2rad(readback.joint_sd_deg)), readback.slide_sd_m
        return cls(
            np.deg2rad(hits.angle_sd_deg), 1e-3 * hits.offset_sd_mm, sensor.gain_sd_percent / 100,
            sensor.cross_axis_sd_percent / 100, np.deg2rad(sensor.mounting_sd_deg),
            1e-3 * sensor.position_sd_mm, sensor.force_gain_sd_percent / 100,
            joint_rad=tuple(np.where(slides, shifts, turns)) if any(slides) else turns,
        )  # fmt: skip

    @property
    def across(self) -> float:
        """Of what a channel shows of another: its sensitivity across, and how the sensor sits."""
        return float(np.hypot(self.cross_axis, self.mounting_rad))


# Of FRFs that are computed, or taken for exact.
EXACT_HITS = Tolerances(*(0.0,) * 12)

OF_HIT, OF_SENSOR, OF_HAMMER = 4, 12, 2  # numbers of each hit axis, each sensor, and of all


@dataclass(frozen=True)
class NuisanceCounts:
    """How many numbers FRFs (…, r, c, F) leave open: of hits, then of the chain, then of joints."""

    hits: int
    chain: int

    @classmethod
    def of(cls, h: np.ndarray) -> "NuisanceCounts":
        """Of FRFs between some points."""
        rows, columns = h.shape[-3:-1]
        return cls(OF_HIT * columns, OF_SENSOR * (rows // 3) + OF_HAMMER)

    @property
    def known(self) -> int:
        """Of hits and chain: those of the joints follow."""
        return self.hits + self.chain

    @property
    def seated(self) -> int:
        """Of the chain, the first: each sensor's matrix and place, and the hammer's gain."""
        return self.chain - 1


# Of one hit point and one sensor: what is predicted at the tool.
HIT_NUMBERS = 3 * OF_HIT


def basis(h: np.ndarray, motion: Motion, s: np.ndarray, t: Tolerances) -> np.ndarray:
    """Changes (n, l, r, c, F) of FRFs h (n, r, c, F) per sd, as `NuisanceCounts` counts them.

    Those of the joints are there where the matrices behind `motion` have their slopes. Where it
    knows of actual ports, h and the changes are around those.
    """
    n, rows, columns, lines = h.shape
    numbers, actual, by_angle = NuisanceCounts.of(h), motion.actual, motion.by_angle
    joints = 0 if by_angle is None else by_angle.shape[1]
    # All is written once, in place: such arrays are large.
    out = np.zeros((n, numbers.known + joints, rows, columns, lines), dtype=complex)
    by_axis = out[:, : numbers.hits].reshape(n, columns, OF_HIT, rows, columns, lines)
    # A miss along an axis changes the column of that axis only: a view of these.
    of_hits = np.einsum("namiaf->namif", by_axis)
    hit_basis(h if actual is None else motion.forces, motion.moment, t, of_hits)
    of_chain = out[:, numbers.hits : numbers.known]
    _of_chain(h if actual is None else motion.true_accelerance, motion.turning, t, of_chain)
    if actual is not None:
        for sensor in range(rows // 3):
            places = of_chain[:, OF_SENSOR * sensor + 9 : OF_SENSOR * (sensor + 1)]
            places[:] = np.einsum("nij,nkjcf->nkicf", actual.matrix, places)
    np.multiply(h, t.force_gain, out=of_chain[:, -2])
    np.multiply(h, -t.delay_s * s[:, None, None], out=of_chain[:, -1])
    if by_angle is not None:
        sd = np.broadcast_to(t.joint_rad, joints).reshape(-1, 1, 1, 1)
        np.multiply(by_angle, sd, out=out[:, numbers.known :])
    return out


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


def _of_chain(h: np.ndarray, turning: np.ndarray, t: Tolerances, out: np.ndarray) -> None:
    """Into zeros `out` (n, k, r, c, F): of each sensor's E (9) and place (3), before the hammer."""
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


def real_rows(values: np.ndarray) -> np.ndarray:
    """Real and imaginary parts (k, 2N) of values (k, …), N in each."""
    return np.ascontiguousarray(values, dtype=complex).reshape(len(values), -1).view(float)


def actual_ports(
    eta: np.ndarray, s: np.ndarray, t: Tolerances, shape: tuple[int, int]
) -> ActualPorts:
    """Where hits and sensors were, and the joints stood, whose numbers eta (n, l) are known.

    They are in sds, as `NuisanceCounts` counts them, of FRFs of `shape` (r, c) at s (n, F).
    """
    n, (rows, columns) = len(eta), shape
    numbers = NuisanceCounts(OF_HIT * columns, OF_SENSOR * (rows // 3) + OF_HAMMER)
    missed = eta[:, : numbers.hits].reshape(n, columns, OF_HIT)
    chain = eta[:, numbers.hits : numbers.known]
    # The same changes, of unit forces before unit moments, and of unit motions before unit turns.
    unit = np.eye(2 * columns)[None, ..., None]
    of_hits = hit_basis(unit[:, :, :columns], unit[:, :, columns:], t)[0, ..., 0].real
    hit = np.eye(2 * columns, columns) + np.einsum("ckr,nck->nrc", of_hits, missed)
    unit, of_chain = (
        np.eye(2 * rows)[None, ..., None],
        np.zeros((1, chain.shape[1], rows, 2 * rows, 1)),
    )
    _of_chain(unit[:, :rows], unit[:, rows:], t, of_chain)
    place = np.einsum("krp,nk->nrp", of_chain[0, ..., 0], chain)
    matrix = np.eye(rows) + place[..., :rows]
    place[..., :rows] = np.eye(rows)
    scale = (1 + t.force_gain * chain[:, -2:-1]) * np.exp(-t.delay_s * chain[:, -1:] * s)
    angle = np.asarray(t.joint_rad) * eta[:, numbers.known :]
    return ActualPorts(hit, place, matrix, scale, angle)
