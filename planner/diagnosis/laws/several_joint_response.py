"""Hits on a simulation with several nonlinear joints at once, integrated in time.

As with one joint, the linear part is propagated exactly pole by pole, for torques that are linear
between steps; each step solves for the angles of all the joints by Newton's method.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from planner.diagnosis.laws.equivalent_stiffness import System
from planner.diagnosis.laws.one_joint_response import (
    NEWTON,
    Strokes,
    free_angles,
    kernel,
    modal,
    scale,
    spectra,
    weights,
)
from planner.diagnosis.laws.torque_laws import Law

SAME = 4  # steps over which the tangent is taken as one; Newton's method makes up for it
NUDGE = 1e-4  # of ln a, for derivatives of the torque at given angles
CHUNK = 100  # steps whose derivatives are kept before they go into spectra


@dataclass(frozen=True, eq=False)
class Joints:
    """What m joints see of a system, for c hits on it.

    grow (c, p, 1), drive (c, 2 p, m): z ← grow z + drive τ gives what earlier torques leave, `felt`
    (c, m, 2 p) the angles that follow, real and imaginary parts of z being rows of their own;
    `gives` (c, m, m): the angles that torques give within their own step; `free` (n, c, m) in rad:
    the angles without torques; `stiffness` (m,) of the springs; `rest` (c, m) is the state of the
    law before, if it is not 0.
    """

    grow: np.ndarray
    drive: np.ndarray
    felt: np.ndarray
    gives: np.ndarray
    free: np.ndarray
    stiffness: np.ndarray
    rest: np.ndarray | None = None


def joints_of(system: System, hits: Strokes, fastest_hz: float) -> Joints:
    """The joints' poles and angles without torques, for every hit, at all ports of the system."""
    n, m = len(system.mass), len(system.blocks)
    e = 2 * len(system.elasticity.stiffness)  # overdamped poles come singly
    drive, felt = np.zeros((n, e, m), dtype=complex), np.zeros((n, m, e), dtype=complex)
    grow, gives = np.zeros((n, e), dtype=complex), np.zeros((n, m, m))
    free = np.empty((hits.force.shape[1], len(hits.visit), m))
    for i in range(n):
        poles, shapes, entry = modal(system, i)
        at, into, struck = shapes[system.blocks], entry[:, system.blocks], entry @ system.hit[i].T
        slow = np.abs(poles) < 2 * np.pi * fastest_hz
        count = int(slow.sum())
        at_once = -(at / poles)[:, ~slow]
        rule = weights(poles[slow], hits.step_s)
        grow[i, :count] = rule[0]
        drive[i, :count] = into[slow] * (rule[2] + rule[1] / rule[0])[:, None]
        felt[i, :, :count] = at[:, slow]
        gives[i] = (at[:, slow] @ (into[slow] * rule[2][:, None]) + at_once @ into[~slow]).real
        here = np.flatnonzero(hits.visit == i)
        static = (at_once @ struck[~slow]).real[:, hits.axis[here]]
        entered = struck[slow][:, hits.axis[here]]
        for j in range(m):
            weight = at[j, slow][:, None] * entered
            free[:, here, j] = free_angles(hits, here, poles[slow], weight, rule)
            free[:, here, j] += static[j] * hits.force[here].T
    v, used = hits.visit, np.any(grow != 0, axis=0)
    into, out = drive[v][:, used], felt[v][:, :, used]
    return Joints(
        grow[v][:, used, None],
        np.concatenate([into.real, into.imag], axis=1),
        np.concatenate([out.real, -out.imag], axis=2),
        gives[v],
        free,
        system.elasticity.stiffness[system.blocks],
    )


def _grown(grow: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The modal states z (c, 2 p, d) one step later, without torques."""
    p = grow.shape[1]
    real, imaginary = z[:, :p], z[:, p:]
    return np.concatenate(
        [
            grow.real * real - grow.imag * imaginary,
            grow.real * imaginary + grow.imag * real,
        ],
        axis=1,
    )


@dataclass(frozen=True, eq=False)
class Instant:
    """A step: angles before and now, torques and their slopes, states before it (c, m)."""

    before: np.ndarray
    now: np.ndarray
    torque: np.ndarray
    slope: np.ndarray
    state: np.ndarray


def instants(law: Law, k: np.ndarray, a: np.ndarray, joints: Joints) -> Iterator[Instant]:
    """Every hit step by step; k, a (m,) are the law's numbers at each joint."""
    _, c, m = joints.free.shape
    z = np.zeros((c, 2 * joints.grow.shape[1], 1))
    before, rise = np.zeros((c, m)), np.zeros((c, m))
    state = np.zeros((c, m)) if joints.rest is None else joints.rest
    inverse, one = np.zeros((c, m, m)), np.eye(m)
    slope = law.step(np, k, a, state, before, before)[1] + np.zeros((c, m))
    for i, alone in enumerate(joints.free):
        z = _grown(joints.grow, z)
        free = alone[..., None] - joints.felt @ z
        now = before + rise
        if i % SAME == 0:
            inverse = np.linalg.inv(one + joints.gives * slope[:, None, :])
        for _ in range(NEWTON):
            torque = law.step(np, k, a, state, before, now)[0]
            error = now[..., None] + joints.gives @ torque[..., None] - free
            now = now - (inverse @ error)[..., 0]
        torque, slope, after = law.step(np, k, a, state, before, now)
        z += joints.drive @ torque[..., None]
        yield Instant(before, now, torque, slope, state)
        rise, before, state = now - before, now, after


@dataclass(frozen=True, eq=False)
class TorqueSpectra:
    """Spectra (m, c, F) of torques in N·m·s, and what they add to springs (c, m) in N·m/rad.

    That is the mean of a hit's torque over its angle, weighed by the square of the angle.
    """

    spectrum: np.ndarray
    stiffer: np.ndarray


def torque_spectra(
    law: Law, k: np.ndarray, a: np.ndarray, joints: Joints, hits: Strokes, s: np.ndarray
) -> TorqueSpectra:
    """Torques' spectra and added stiffness, for every hit."""
    angle, torque = np.empty(joints.free.shape), np.empty(joints.free.shape)
    for i, at in enumerate(instants(law, k, a, joints)):
        angle[i], torque[i] = at.now, at.torque
    spectrum = np.array([spectra(torque[:, :, j], hits, s) for j in range(len(k))])
    fade = np.exp(-2 * s[0].real * hits.step_s * np.arange(len(angle)))
    power = np.einsum("n,ncm,ncm->cm", fade, angle, angle)
    work = np.einsum("n,ncm,ncm->cm", fade, angle, torque)
    return TorqueSpectra(spectrum, work / np.maximum(power, 1e-300))


def rates(
    law: Law, k: np.ndarray, a: np.ndarray, joints: Joints, hits: Strokes, s: np.ndarray
) -> np.ndarray:
    """Derivatives of the torques' spectra (3, m, m, c, F) by ln k, ln a and ln stiffness (m,) each.

    They follow the hits' swings as they fade: linear equations whose coefficients change in time.
    """
    n, c, m = joints.free.shape
    d, p, j = 3 * m, joints.grow.shape[1], np.arange(m)
    turn, kept = kernel(n, hits, s), np.empty((CHUNK, c * m * d))
    out = np.zeros((len(s), c * m * d), dtype=complex)
    one, inverse = np.eye(m), np.zeros((c, m, m))
    z, moved, state = np.zeros((c, 2 * p, d)), np.zeros((c, m, d)), np.zeros((c, m, d))
    for i, at in enumerate(instants(law, k, a, joints)):
        z = _grown(joints.grow, z)
        source = np.zeros((c, m, d))
        further = law.step(np, k, a * (1 + NUDGE), at.state, at.before, at.now)[0]
        source[:, j, m + j] = (further - at.torque) / NUDGE
        if law.remembers:
            keep = k * np.exp(-np.abs(at.now - at.before) / a)
            source += keep[..., None] * state - at.slope[..., None] * moved
        remembered = source.copy()
        source[:, j, j] += at.torque
        source[:, j, 2 * m + j] += joints.stiffness * at.now
        error = -(joints.felt @ z) - joints.gives @ source
        tangent = one + joints.gives * at.slope[:, None, :]
        if i % SAME == 0:
            inverse = np.linalg.inv(tangent)
        moved = inverse @ error
        moved += inverse @ (error - tangent @ moved)
        with_angle = at.slope[..., None] * moved
        state = (with_angle + remembered) / k[:, None]
        torque = with_angle + source
        z += joints.drive @ torque
        kept[i % CHUNK] = torque.ravel()
        if (i + 1) % CHUNK == 0 or i == n - 1:
            some = kept[: i % CHUNK + 1]
            part = turn[:, i + 1 - len(some) : i + 1]
            out += part.real @ some + 1j * (part.imag @ some)
    found = out.T.reshape(c, m, 3, m, len(s)) * scale(hits, s)[:, None, None, None]
    return np.moveaxis(found, (2, 3, 1), (0, 1, 2))
