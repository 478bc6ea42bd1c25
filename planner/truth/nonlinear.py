"""Hits on robots whose joints are not linear, and on robots with structural damping.

At a pose the mass matrix is constant: the linear part is propagated exactly pole by pole, and
nonlinear torques act on it as forces that are linear between samples.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from planner.errors import InputError
from planner.truth.laws import JointLaw
from planner.truth.model import Truth
from planner.truth.propagate import driven, weights

MOST_CONTRACTION = 0.5  # of the fixed-point iteration within a step
TORQUE_ACCURACY = 1e-7  # relative to a step's change of torque
FFT_PADDING = 4  # record lengths, so that the response does not wrap around


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
class StruckPose:
    """A robot at a pose q (rad), and forces (h, n) in N that hit it.

    `wrench` (h, 6) is what a unit of each force does at the tcp, in its frame: the force's
    direction, and the moment in m about the tcp of one that lands beside it.
    """

    truth: Truth
    q: np.ndarray
    forces_n: np.ndarray
    wrench: np.ndarray


def along(axes: Sequence[int]) -> np.ndarray:
    """Wrenches (h, 6) of hits exactly along tcp axes 0..2 (h,) and exactly at the tcp."""
    return np.eye(6)[list(axes)]


@dataclass(frozen=True, eq=False)
class _Linear:
    """A pose's linear system, seen from P ports; of conjugate poles one is kept."""

    poles: np.ndarray  # (p,)
    inputs: np.ndarray  # (p, P): what a torque at a port drives
    outputs: np.ndarray  # (P, p): what a port feels
    sensed: np.ndarray  # (3, p): acceleration
    direct: np.ndarray  # (3, P): acceleration that follows a torque at once
    accelerations: np.ndarray  # (h, 3, n), without the laws
    angles: np.ndarray  # (P, h, n), without the laws


def respond(poses: Sequence[StruckPose], ports: Sequence[Port], step_s: float) -> list[np.ndarray]:
    """Accelerations (h, 3, n) in m/s² of the sensor at each pose, from rest.

    The poses are integrated together, so all forces have the same length. Raises InputError if
    the step is too long for a law.
    """
    linear = [_linear(pose, ports, step_s) for pose in poses]
    if not ports:
        return [pose.accelerations for pose in linear]
    torques = _torques(ports, linear, step_s)
    found = []
    for pose, torque in zip(linear, torques, strict=True):
        out = pose.accelerations - np.einsum("sp,phn->hsn", pose.direct, torque)
        for k, pole in enumerate(pose.poles):
            y = driven(pole, np.einsum("p,phn->hn", pose.inputs[k], torque), step_s)
            out -= np.einsum("s,hn->hsn", pose.sensed[:, k], y).real
        found.append(out)
    return found


def _linear(pose: StruckPose, ports: Sequence[Port], step_s: float) -> _Linear:
    truth, forces = pose.truth, pose.forces_n
    poles, shapes, entry, hit, sensor = truth.modal(pose.q)
    one = poles.imag >= 0  # the other of a pair adds the conjugate
    poles, entry = poles[one], entry[one]
    shapes = shapes[:, one] * np.where(poles.imag > 0, 2.0, 1.0)
    at = np.array([port.vector(truth, pose.q) for port in ports]).reshape(len(ports), len(shapes))
    drive = np.vstack([hit, truth.turning(pose.q)]).T @ pose.wrench.T  # (e, h)
    inputs, outputs = entry @ drive, at @ shapes
    sensed, direct = sensor @ shapes * poles**2, sensor @ np.linalg.inv(truth.matrices(pose.q)[0])
    out = np.einsum("sh,hn->hsn", direct @ drive, forces)
    angles = np.zeros((len(ports), *forces.shape))
    for k, pole in enumerate(poles):
        y = driven(pole, forces, step_s) * inputs[k][:, None]
        out += np.einsum("s,hn->hsn", sensed[:, k], y).real
        angles += np.einsum("p,hn->phn", outputs[:, k], y).real
    return _Linear(poles, entry @ at.T, outputs, sensed, direct @ at.T, out, angles)


def _torques(ports: Sequence[Port], linear: Sequence[_Linear], step_s: float) -> list[np.ndarray]:
    """Torques (P, h, n) of the laws at each pose.

    Each step solves θ = θ_free - G τ(θ) by fixed-point iteration, G being what the ports give way
    within a step; it is so small that a few iterations are exact.
    """
    hits = [pose.angles.shape[1] for pose in linear]
    most = max(len(pose.poles) for pose in linear)

    def columns(of: Callable[[_Linear], np.ndarray]) -> np.ndarray:
        """One column (p, ..., hits) per hit; poses with overdamped poles have more of them."""
        padded = []
        for pose, count in zip(linear, hits, strict=True):
            a = of(pose)
            a = np.concatenate([a, np.zeros((most - len(a), *a.shape[1:]))])
            padded.append(np.repeat(a[..., None], count, axis=-1))
        return np.concatenate(padded, axis=-1)

    grow = columns(lambda pose: weights(pose.poles, step_s)[0])
    older = columns(lambda pose: weights(pose.poles, step_s)[1][:, None] * pose.inputs)
    newer = columns(lambda pose: weights(pose.poles, step_s)[2][:, None] * pose.inputs)
    felt = columns(lambda pose: pose.outputs.T)
    gives = np.real(np.einsum("kph,kqh->pqh", felt, newer))
    slopes = np.array([port.law.slope for port in ports])
    contraction = float(np.max(np.einsum("pqh,q->ph", np.abs(gives), slopes)))
    if contraction > MOST_CONTRACTION:
        raise InputError("A nonlinear joint is too stiff for the time step; shorten the step.")
    iterations = max(2, int(np.ceil(np.log(TORQUE_ACCURACY) / np.log(contraction))))

    steps = np.moveaxis(np.concatenate([pose.angles for pose in linear], axis=1), 2, 0).copy()
    torques = np.zeros_like(steps)
    before, states = np.zeros_like(steps[0]), np.zeros_like(steps[0])
    y = np.zeros(grow.shape, dtype=complex)
    for i in range(1, len(steps)):
        y = grow * y - (older * torques[i - 1]).sum(axis=1)
        free = steps[i] + (felt * y[:, None]).sum(axis=0).real
        torque, after, now = torques[i - 1], states, before
        for _ in range(iterations):
            now = free - (gives * torque).sum(axis=1)
            torques_after = [
                p.law.torque(s, b, t) for p, s, b, t in zip(ports, states, before, now, strict=True)
            ]
            torque, after = (np.array(part) for part in zip(*torques_after, strict=True))
        y -= (newer * torque).sum(axis=1)
        torques[i], before, states = torque, now, after
    return np.split(np.moveaxis(torques, 0, 2), np.cumsum(hits)[:-1], axis=1)


def structural(pose: StruckPose, loss_factor: float, step_s: float) -> np.ndarray:
    """As `respond`, with K(1 + iη) instead of viscous damping: from the spectrum of the force."""
    n = pose.forces_n.shape[1]
    frequency = np.fft.rfftfreq(FFT_PADDING * n, step_s)
    accelerance = structural_accelerance(pose.truth, loss_factor, pose.q, frequency, pose.wrench)
    spectrum = np.fft.rfft(pose.forces_n, FFT_PADDING * n, axis=1)
    response = np.moveaxis(accelerance, 1, 0) * spectrum[:, None]
    return np.fft.irfft(response, FFT_PADDING * n, axis=2)[:, :, :n]


def structural_accelerance(
    truth: Truth,
    loss_factor: float,
    q: np.ndarray,
    frequency_hz: np.ndarray,
    wrench: np.ndarray | None = None,
) -> np.ndarray:
    """Accelerance (3, h, F) in m/s²/N: -ω² Σ φφᵀ / (μ - ω²) of K (1 + iη) + G.

    μ are the complex eigenvalues of that matrix and M, G is gravity's part, which has no loss. Of
    hits `wrench` (h, 6) as in `StruckPose`, or of those along the three axes.
    """
    mass, _, stiffness, hit, sensor = truth.matrices(q)
    if wrench is not None:
        hit = wrench @ np.vstack([hit, truth.turning(q)])
    gravity = truth.gravity_stiffness(q)
    springs = (stiffness + stiffness.T) / 2 - gravity
    squares, shapes = scipy.linalg.eig(springs * (1 + 1j * loss_factor) + gravity, mass)[:2]
    shapes = shapes / np.sqrt(np.einsum("ik,ij,jk->k", shapes, mass, shapes))
    w2 = (2 * np.pi * np.asarray(frequency_hz)) ** 2
    shares = -w2 / (squares[:, None] - w2)
    return np.einsum("sk,hk,kf->shf", sensor @ shapes, hit @ shapes, shares)
