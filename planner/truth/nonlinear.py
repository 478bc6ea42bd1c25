"""Hits on robots whose joints are not linear, and on robots with structural damping.

At a pose the mass matrix is constant: the linear part is propagated exactly pole by pole, and
nonlinear torques act on it as forces that are linear between samples.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from planner.errors import InputError
from planner.truth.laws import Law
from planner.truth.model import Truth, driven, weights

ITERATIONS = 6
CONTRACTION = 0.5  # of the fixed-point iteration within a step; 6 iterations leave 2 %
PADDING = 4


@dataclass(frozen=True)
class Port:
    """Where a law acts: about a joint's own axis, or on a point of a link along a direction.

    `link_point_m` is in the link's frame, `direction` in the world's.
    """

    law: Law
    joint: str = ""
    link: str = ""
    link_point_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    direction: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def vector(self, truth: Truth, q: np.ndarray) -> np.ndarray:
        """The port's displacement per elastic coordinate (e,)."""
        if self.joint:
            return truth.own(self.joint)
        return truth.along(q, self.link, np.array(self.link_point_m), np.array(self.direction))


def respond(
    truth: Truth,
    ports: Sequence[Port],
    q: np.ndarray,
    forces_n: np.ndarray,
    axes: Sequence[int],
    step_s: float,
) -> np.ndarray:
    """Accelerations (h, 3, n) in m/s² to forces (h, n), hit h along tcp axis axes[h], from rest."""
    poles, shapes, entry, hit, sensor = truth.modal(q)
    one = poles.imag >= 0  # the other of a pair adds the conjugate
    poles, entry = poles[one], entry[one]
    shapes = shapes[:, one] * np.where(poles.imag > 0, 2.0, 1.0)
    at = np.array([port.vector(truth, q) for port in ports]).reshape(len(ports), len(shapes))
    inputs = entry @ hit.T  # (p, 3)
    direct = sensor @ np.linalg.inv(truth.matrices(q)[0])

    out = np.einsum("sh,hn->hsn", (direct @ hit.T)[:, list(axes)], forces_n)
    angles = np.zeros((len(ports), *forces_n.shape))
    for k, pole in enumerate(poles):
        y = driven(pole, forces_n, step_s) * inputs[k, list(axes)][:, None]
        out += np.einsum("s,hn->hsn", (sensor @ shapes[:, k]) * pole**2, y).real
        angles += np.einsum("p,hn->phn", at @ shapes[:, k], y).real
    if not ports:
        return out
    torques = _torques(ports, angles, poles, entry @ at.T, at @ shapes, step_s)
    out -= np.einsum("sp,phn->hsn", direct @ at.T, torques)
    for k, pole in enumerate(poles):
        y = driven(pole, np.einsum("p,phn->hn", entry[k] @ at.T, torques), step_s)
        out -= np.einsum("s,hn->hsn", (sensor @ shapes[:, k]) * pole**2, y).real
    return out


def _torques(
    ports: Sequence[Port],
    angles: np.ndarray,
    poles: np.ndarray,
    inputs: np.ndarray,
    outputs: np.ndarray,
    step_s: float,
) -> np.ndarray:
    """Torques (P, h, n) of the laws; `angles` (P, h, n) are those that the hits alone give.

    inputs (p, P) and outputs (P, p) tell how the ports drive the poles and feel them. Each step
    solves θ = θ_free - G τ(θ) by fixed-point iteration, G being what a step itself gives way.
    """
    grow, older, newer = (w[:, None] for w in weights(poles, step_s))
    gives = np.real(outputs @ (newer * inputs))
    slopes = [port.law.slope for port in ports]
    if np.max(np.abs(gives) @ slopes) > CONTRACTION:
        raise InputError("A nonlinear joint is too stiff for the time step; shorten the step.")
    count, hits, n = angles.shape
    torques = np.zeros((count, hits, n))
    y = np.zeros((len(poles), hits), dtype=complex)
    states, before = np.zeros((count, hits)), np.zeros((count, hits))
    now, after, old = before, states, torques[:, :, 0]
    from_old, from_new = older * inputs, newer * inputs
    steps = np.ascontiguousarray(np.moveaxis(angles, 2, 0))
    for i in range(1, n):
        y = grow * y - from_old @ old
        free = steps[i] + (outputs @ y).real
        torque = old
        for _ in range(ITERATIONS):
            now = free - gives @ torque
            found = [
                p.law.torque(s, b, t) for p, s, b, t in zip(ports, states, before, now, strict=True)
            ]
            newer_torque = np.array([f[0] for f in found])
            done = np.max(np.abs(newer_torque - torque)) <= 1e-9 * (1e-9 + np.max(np.abs(torque)))
            torque = newer_torque
            if done:
                break
        after = np.array([f[1] for f in found])
        y = y - from_new @ torque
        torques[:, :, i] = torque
        before, states, old = now, after, torque
    return torques


def structural(
    truth: Truth,
    loss_factor: float,
    q: np.ndarray,
    forces_n: np.ndarray,
    axes: Sequence[int],
    step_s: float,
) -> np.ndarray:
    """As `respond`, with K(1 + iη) instead of viscous damping: from the spectrum of the force."""
    n = forces_n.shape[1]
    frequency = np.fft.rfftfreq(PADDING * n, step_s)
    accelerance = structural_accelerance(truth, loss_factor, q, frequency)
    spectrum = np.fft.rfft(forces_n, PADDING * n, axis=1)
    response = np.moveaxis(accelerance[:, list(axes)], 1, 0) * spectrum[:, None]
    return np.fft.irfft(response, PADDING * n, axis=2)[:, :, :n]


def structural_accelerance(
    truth: Truth, loss_factor: float, q: np.ndarray, frequency_hz: np.ndarray
) -> np.ndarray:
    """Accelerance (3, 3, F) in m/s²/N: -ω² Σ φφᵀ / (ω_r² (1 + iη) - ω²)."""
    mass, _, stiffness, hit, sensor = truth.matrices(q)
    squares, shapes = scipy.linalg.eigh((stiffness + stiffness.T) / 2, mass)
    w2 = (2 * np.pi * np.asarray(frequency_hz)) ** 2
    shares = -w2 / (squares[:, None] * (1 + 1j * loss_factor) - w2)
    return np.einsum("sk,hk,kf->shf", sensor @ shapes, hit @ shapes, shares)
