"""How recordings change to first order with what is not concealed: robot, hits, measuring chain.

Every column belongs to one unknown number and is multiplied by that number's standard deviation.
"""

from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace

import numpy as np

from planner.truth.deviation import Scatter
from planner.truth.handling import Aim, Handling, MeasuringChain
from planner.truth.hits import AXES, Hammer, SimulatedHit
from planner.truth.model import Truth
from planner.truth.secret import HitVisit, Secret

STEP = 1e-3  # relative (of angles: rad; of centres: m), for differences of matrices
METRE = 1.0  # the response is linear in the sensor's place, so that any step is exact


@dataclass(frozen=True, eq=False)
class Columns:
    """Of one hit, each (3 F, columns): complex accelerations of a channel after the other.

    `robot` and `chain` hold numbers that are the same in the whole campaign, `pose` those of a
    pose, `hit` those of the hit alone.
    """

    robot: np.ndarray
    chain: np.ndarray
    pose: np.ndarray
    hit: np.ndarray


@dataclass(frozen=True, eq=False)
class _PoseChanges:
    """Receptances (F, 3, 6) from wrenches at the tcp, and their changes, one a column."""

    receptance: np.ndarray
    robot: list[np.ndarray]
    place: list[np.ndarray]
    readback: list[np.ndarray]


def columns(
    truth: Truth,
    secret: Secret,
    visit: HitVisit,
    hits: list[SimulatedHit],
    scatter: Scatter,
    handling: Handling,
    hammer: Hammer,
    used: np.ndarray,
    rate_1_s: float,
) -> list[Columns]:
    """One for each of a visit's quiet hits, at the lines `used` (lines,) of `rfft`.

    Of accelerations and forces times exp(-rate t), in which a decay that the record cuts off is no
    error: their spectra are transforms at iω + rate. `hits` are without it. `truth` is the linear
    one; what a nonlinear law changes in the columns is left out.
    """
    chain = secret.chain
    truth = secret.at(replace(truth, sensor_offset_m=chain.offset_m), visit.progress)
    n, step_s = hits[0].force_n.size, 1 / hammer.sampling_rate_hz
    at = 2j * np.pi * np.fft.rfftfreq(n, step_s)[used] + rate_1_s
    window = np.exp(-rate_1_s * step_s * np.arange(n))
    pose = _pose(truth, visit.q, at, scatter, handling)
    aims = visit.aims or [Aim()] * len(hits)
    out = []
    for hit, aim in zip(hits, aims, strict=True):
        axis, sense = AXES.index(hit.axis[1]), -1.0 if hit.axis[0] == "-" else 1.0
        force = sense * np.fft.rfft(window * hit.force_n)[used] / chain.force_gain
        drive = at**2 * force * np.exp(-at * chain.delay_s)
        out.append(_of_hit(pose, axis, aim, drive, at, chain, handling))
    return out


def _of_hit(
    pose: _PoseChanges,
    axis: int,
    aim: Aim,
    drive: np.ndarray,
    s: np.ndarray,
    chain: MeasuringChain,
    handling: Handling,
) -> Columns:
    wrench = aim.wrench(axis)

    def heard(receptances: list[np.ndarray], way: np.ndarray = wrench) -> list[np.ndarray]:
        return [(chain.matrix @ (r @ way * drive[:, None]).T).ravel() for r in receptances]

    def packed(found: list[np.ndarray]) -> np.ndarray:
        return np.array(found).reshape(len(found), 3 * len(drive)).T

    raw = (pose.receptance @ wrench * drive[:, None]).T
    whole = (chain.matrix @ raw).ravel()
    across = [e for e in np.eye(3) if e[axis] == 0]
    own = [Aim(direction=d) for d in across], [Aim(offset_m=d) for d in across]
    misses = [[a.wrench(axis) - Aim().wrench(axis) for a in group] for group in own]
    felt = [[heard([pose.receptance], w)[0] for w in group] for group in misses]
    angle, aim_angle = np.deg2rad([handling.angle_deg, handling.aim_deg])
    hit = [angle * c for c in felt[0]] + [handling.offset_m * c for c in felt[1]]
    shared = [aim_angle * c for c in felt[0]] + [handling.aim_m * c for c in felt[1]]
    zero = np.zeros_like(whole)
    common = [c if k == axis else zero for k in range(3) for c in shared]
    rest = [handling.force_gain * whole, handling.delay_s * (np.tile(-s, 3) * whole)]
    place = [handling.position_m * c for c in heard(pose.place)]
    return Columns(
        packed(heard(pose.robot)),
        packed([*_matrix(raw, handling), *place, *rest, *common]),
        packed(heard(pose.readback)),
        packed(hit),
    )


def _matrix(raw: np.ndarray, handling: Handling) -> list[np.ndarray]:
    """Of the nine entries of the chain's matrix; raw (3, F) is what the sensor feels."""
    beside = float(np.hypot(handling.cross_axis, np.deg2rad(handling.mounting_deg)))
    out = []
    for i, j in np.ndindex(3, 3):
        column = np.zeros_like(raw)
        column[i] = (handling.gain if i == j else beside) * raw[j]
        out.append(column.ravel())
    return out


def _pose(
    truth: Truth, q: np.ndarray, s: np.ndarray, scatter: Scatter, handling: Handling
) -> _PoseChanges:
    mass, damping, stiffness, drive, sensor = _matrices(truth, q)
    own = truth.factors(q) * [spring.stiffness for spring in truth.springs]
    relaxing = np.zeros((len(s), len(own)), dtype=complex)  # what loss factors add to each spring
    for j, more, rate in truth.relaxing(q):
        relaxing[:, j] += more * s / (s + rate)
    s = s[:, None, None]
    whole = stiffness + s * damping + s**2 * mass + relaxing[:, None] * np.eye(len(own))
    inverse = np.linalg.inv(whole)
    left, right = sensor @ inverse, inverse @ drive  # (F, 3, e), (F, e, 6)

    def change(of_mass: np.ndarray, of_stiffness: np.ndarray) -> np.ndarray:
        return -left @ (s**2 * of_mass + of_stiffness) @ right

    springs, losses = [], []
    for j in range(truth.stated):
        one, more = left[:, :, j, None] * right[:, None, j, :], relaxing[:, j, None, None]
        springs.append(-(own[j] + more) * one)
        losses.append(-(s * damping[j, j] + more) * one)
    robot = [scatter.stiffness * k for k in springs] + [scatter.damping * c for c in losses]
    if scatter.common_sd > 0:
        robot.append(scatter.common_sd * sum(springs))
    for change_of, sd in _inertias(truth, scatter):
        with change_of:
            near = _matrices(truth, q)
        robot.append(sd / STEP * change(near[0] - mass, near[2] - stiffness))
    readback = []
    for turn in STEP * np.eye(len(q)) if handling.readback_deg else ():
        near = _matrices(truth, q + turn)
        moved = (near[4] - sensor) @ right + left @ (near[3] - drive)
        moved = moved + change(near[0] - mass, near[2] - stiffness)
        readback.append(np.deg2rad(handling.readback_deg) / STEP * moved)
    place = []
    for shift in METRE * np.eye(3) if handling.position_m else ():
        x, y, z = shift + truth.sensor_offset_m
        there = replace(truth, sensor_offset_m=(float(x), float(y), float(z)))
        place.append((_matrices(there, q)[4] - sensor) @ right / METRE)
    return _PoseChanges(left @ drive, robot, place, readback)


def _matrices(truth: Truth, q: np.ndarray) -> tuple[np.ndarray, ...]:
    """M, C, K (e, e), what a wrench at the tcp drives (e, 6), and the sensor's Jacobian (3, e)."""
    mass, damping, stiffness, hit, sensor = truth.matrices(q)
    return mass, damping, stiffness, np.vstack([hit, truth.turning(q)]).T, sensor


def _inertias(
    truth: Truth, scatter: Scatter
) -> Iterator[tuple[AbstractContextManager[None], float]]:
    """(context in which the model is changed by STEP, standard deviation) of inertial numbers."""
    for link in truth.links():
        kinds = [(scatter.inertia, truth.other_inertia(link, mass=1 + STEP))]
        kinds.append((scatter.inertia, truth.other_inertia(link, turn=1 + STEP)))
        kinds += [(scatter.com_m, truth.other_inertia(link, shift=STEP * e)) for e in np.eye(3)]
        yield from ((how, sd) for sd, how in kinds if sd > 0)
