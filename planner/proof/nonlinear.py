"""Hits on robots whose joints are not linear.

At a pose the mass matrix is constant: the linear part is propagated exactly pole by pole, and
nonlinear torques act on it as forces that are linear between samples.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from planner.errors import InputError
from planner.proof.laws import JointLaw, stacked
from planner.proof.model import Truth, driven, weights

MOST_CONTRACTION = 0.5  # of the fixed-point iteration within a step
TORQUE_ACCURACY = 1e-7  # relative to a step's change of torque


@dataclass(frozen=True)
class Port:
    """Where a law acts: about a joint's own axis, or on a point of a link along a direction.

    `link_point_m` is in the link's frame, `direction` in the world's.
    """

    law: JointLaw
    joint: str = ""
    link: str = ""
    link_point_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    direction: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def vector(self, truth: Truth, q: np.ndarray) -> np.ndarray:
        """The port's displacement per elastic coordinate (e,)."""
        if self.joint:
            return truth.own(self.joint)
        return truth.along(q, self.link, np.array(self.link_point_m), np.array(self.direction))


@dataclass(frozen=True, eq=False)
class HitPose:
    """A robot at a pose q (rad), and forces (h, n) in N that hit it.

    `wrench` (h, 6) is what a unit of each force does at the tcp, in its frame: the force's
    direction, and the moment in m about the tcp of one that lands beside it.
    """

    truth: Truth
    q: np.ndarray
    forces_n: np.ndarray
    wrench: np.ndarray


@dataclass(frozen=True, eq=False)
class _Linear:
    """A pose's linear system, seen from P ports; of conjugate poles one is kept."""

    poles: np.ndarray  # (p,)
    driven: np.ndarray  # (p, h): what the forces drive
    inputs: np.ndarray  # (p, P): what a torque at a port drives
    outputs: np.ndarray  # (P, p): what a port feels
    sensed: np.ndarray  # (3, p): acceleration
    struck: np.ndarray  # (3, h): acceleration that follows a force at once
    direct: np.ndarray  # (3, P): acceleration that follows a torque at once
    forces: np.ndarray  # (h, n)


def respond(poses: Sequence[HitPose], ports: Sequence[Port], step_s: float) -> list[np.ndarray]:
    """Accelerations (h, 3s, n) in m/s² of the sensors at each pose, from rest.

    The poses are integrated together, so all forces have the same length. Raises InputError if
    the step is too long for a law.
    """
    linear = [_linear(pose, ports) for pose in poses]
    if ports:
        return _integrated(ports, linear, step_s)
    return [_without_laws(pose, step_s) for pose in linear]


def _linear(pose: HitPose, ports: Sequence[Port]) -> _Linear:
    truth = pose.truth
    poles, shapes, entry, hit, sensor = truth.modal(pose.q)
    one = poles.imag >= 0  # the other of a pair adds the conjugate
    poles, entry = poles[one], entry[one]
    shapes = shapes[:, one] * np.where(poles.imag > 0, 2.0, 1.0)
    at = np.array([port.vector(truth, pose.q) for port in ports]).reshape(len(ports), len(shapes))
    drive = np.vstack([hit, truth.turning(pose.q)]).T @ pose.wrench.T  # (e, h)
    sensed, direct = sensor @ shapes * poles**2, sensor @ np.linalg.inv(truth.matrices(pose.q)[0])
    return _Linear(
        poles, entry @ drive, entry @ at.T, at @ shapes, sensed, direct @ drive, direct @ at.T,
        pose.forces_n,
    )  # fmt: skip


def _without_laws(pose: _Linear, step_s: float) -> np.ndarray:
    y = np.array([driven(pole, pose.forces, step_s) for pole in pose.poles])
    y = y * pose.driven[:, :, None]
    flat, (_, hits, n) = y.reshape(len(y), -1), y.shape
    heard = pose.sensed.real @ flat.real - pose.sensed.imag @ flat.imag
    return np.moveaxis(heard.reshape(-1, hits, n), 0, 1) + (
        pose.struck.T[:, :, None] * pose.forces[:, None]
    )


class _Laws:
    """The laws of all ports at once: those of one class are one law of arrays."""

    def __init__(self, ports: Sequence[Port], step_s: float) -> None:
        kinds: dict[type, list[int]] = {}
        for place, port in enumerate(ports):
            kinds.setdefault(type(port.law), []).append(place)
        self._step_s = step_s
        self._groups = [
            (np.array(places), stacked([ports[i].law for i in places])) for places in kinds.values()
        ]

    def at_rest(self, shape: tuple[int, ...]) -> list[np.ndarray]:
        """States, one a class; shape is (poses, ports, hits)."""
        return [law.at_rest((shape[0], len(at), shape[2])) for at, law in self._groups]

    def torques(
        self, states: list[np.ndarray], before: np.ndarray, now: np.ndarray
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """Of angles (poses, ports, hits)."""
        if len(self._groups) == 1:
            out, after = self._groups[0][1].torque(states[0], before, now, self._step_s)
            return out, [after]
        out, afters = np.empty_like(now), []
        for (at, law), state in zip(self._groups, states, strict=True):
            out[:, at], after = law.torque(state, before[:, at], now[:, at], self._step_s)
            afters.append(after)
        return out, afters


def _integrated(
    ports: Sequence[Port], linear: Sequence[_Linear], step_s: float
) -> list[np.ndarray]:
    """Accelerations (h, 3, n) at each pose, step by step for all poses at once.

    Each step solves θ = θ_free - G τ(θ) by fixed-point iteration, G being what the ports give way
    within a step; it is so small that a few iterations are exact. Complex modal coordinates are
    kept as real and imaginary parts, one below the other, and without what a step's own force
    and torque do: these enter as the newer end of a step, and as the older end of the next.
    """
    hits, modes = max(len(p.forces) for p in linear), max(len(p.poles) for p in linear)

    def stacked(of: Callable[[_Linear], np.ndarray], *shape: int) -> np.ndarray:
        """(poses, *shape): poses with overdamped poles have more than others, or fewer hits."""
        rows = [of(pose) for pose in linear]
        pads = [[(0, full - size) for full, size in zip(shape, r.shape, strict=True)] for r in rows]
        return np.array([np.pad(r, pad) for r, pad in zip(rows, pads, strict=True)])

    count = len(ports)
    grow, older, newer = (
        stacked(lambda pose, k=k: weights(pose.poles, step_s)[k], modes)[:, :, None]
        for k in range(3)
    )
    inputs = stacked(lambda p: p.inputs, modes, count)
    blows = stacked(lambda p: p.driven, modes, hits)
    felt = _rows(stacked(lambda p: p.outputs.T, modes, count))
    heard = _rows(stacked(lambda p: p.sensed.T, modes, 3))
    gives, struck = felt @ _columns(newer * inputs), felt @ _columns(newer * blows)
    at_once = heard @ _columns(newer * inputs) + np.array([pose.direct for pose in linear])
    with_force = heard @ _columns(newer * blows) + stacked(lambda p: p.struck, 3, hits)
    pushed, pushed_by = (_columns((grow * newer + older) * of) for of in (inputs, blows))
    iterations = _iterations(ports, gives, step_s)
    laws = _Laws(ports, step_s)
    n = linear[0].forces.shape[1]
    forces = np.moveaxis(stacked(lambda p: p.forces, hits, n), 2, 0)[:, :, None].copy()
    out = np.zeros((n, len(linear), 3, hits))
    before = np.zeros((len(linear), count, hits))
    states, torque = laws.at_rest(before.shape), np.zeros_like(before)
    y = np.zeros((len(linear), 2 * modes, hits))
    real, imaginary = y[:, :modes], y[:, modes:]
    for i in range(1, n):
        free, after, now = felt @ y + struck * forces[i], states, before
        for _ in range(iterations):
            now = free - gives @ torque
            torque, after = laws.torques(states, before, now)
        before, states = now, after
        out[i] = heard @ y + with_force * forces[i] - at_once @ torque
        turned = grow.real * real - grow.imag * imaginary, grow.real * imaginary + grow.imag * real
        real[...], imaginary[...] = turned
        y += pushed_by * forces[i] - pushed @ torque
    out = np.moveaxis(out, 0, 3)
    return [np.moveaxis(out[k, :, : len(pose.forces)], 0, 1) for k, pose in enumerate(linear)]


def _iterations(ports: Sequence[Port], gives: np.ndarray, step_s: float) -> int:
    slopes = np.array([port.law.slope(step_s) for port in ports])
    contraction = float(np.max(np.abs(gives) @ slopes))
    if contraction > MOST_CONTRACTION:
        raise InputError("A nonlinear joint is too stiff for the time step; shorten the step.")
    return max(2, int(np.ceil(np.log(TORQUE_ACCURACY) / np.log(max(contraction, 1e-12)))))


def _columns(modal: np.ndarray) -> np.ndarray:
    """(poses, 2 p, ...) of complex modal quantities (poses, p, ...)."""
    return np.concatenate([modal.real, modal.imag], axis=1)


def _rows(modal: np.ndarray) -> np.ndarray:
    """What gives the real part of their product (poses, a, 2 p), from (poses, p, a)."""
    return np.moveaxis(np.concatenate([modal.real, -modal.imag], axis=1), 1, 2).copy()
