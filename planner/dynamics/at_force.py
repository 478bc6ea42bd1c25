"""A robot whose joints are not linear, linearised for a hit of a stated force.

How far a joint swings after the hit says which spring and damper come nearest to its law along
that swing (least squares of the torque), and these say how far it swings: a fixed point. Hits along
different axes swing joints differently, so that each column of an FRF matrix has springs of its
own; modes are those of the three hits together.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.dynamics.simulation import Elasticity, Simulation
from planner.dynamics.vibration import (
    Poles,
    SimulatedModes,
    accelerance,
    oscillatory,
    solve_poles,
)
from planner.errors import InputError
from planner.robot.elastic_model import Matrices
from planner.robot.joint_laws import LawTable

PER_PERIOD = 10  # instants of the highest frequency of the band
# Time constants of the slowest decay, for which a swing is followed; instants, at most.
FADED, LONGEST = 4.0, 4000
ROUNDS, SETTLED = 60, 1e-4  # of the fixed point: most, and the change of k that ends it


def accelerance_at_force(
    simulation: Simulation, q: np.ndarray, force_n: np.ndarray, frequency_hz: np.ndarray
) -> np.ndarray:
    """Accelerance (n, 3, 3, F) in m/s²/N at q (n, dof) in rad, of hits of peak force_n (n,).

    Raises InputError where a joint has no stiffness left at a force.
    """
    m, n = simulation.elastic.matrices(q), len(q)
    each = replace(m.at(np.repeat(np.arange(n), 3)), hit=m.hit.reshape(3 * n, 1, -1))
    springs = springs_at_force(simulation, each, np.repeat(force_n, 3))
    solved = _poles(each, springs, each.sensor)
    return np.moveaxis(accelerance(solved, frequency_hz).reshape(n, 3, 3, -1), 1, 2)


def modes_at_force(
    simulation: Simulation, q: np.ndarray, force_n: np.ndarray, count: int
) -> SimulatedModes:
    """The `count` lowest oscillatory modes there. Raises as `accelerance_at_force` does."""
    m = simulation.elastic.matrices(q)
    springs = springs_at_force(simulation, m, force_n)
    return oscillatory(_poles(m, springs, m.sensor), count)


def springs_at_force(simulation: Simulation, m: Matrices, force_n: np.ndarray) -> Elasticity:
    """Stiffness and damping (n, e) that laws come nearest to after hits of peak force_n (n,)."""
    config = simulation.robot.config
    own = [simulation.elastic.own_spring(law.joint) for law in config.law]
    ports = np.broadcast_to(
        np.eye(simulation.elastic.size)[own], (len(force_n), len(own), m.mass.shape[1])
    )
    stated = simulation.elasticity
    shape = len(force_n), simulation.elastic.size
    springs = replace(
        stated,
        stiffness=np.broadcast_to(stated.stiffness, shape),
        damping=np.broadcast_to(stated.damping, shape),
    )
    step_s = 1 / (PER_PERIOD * config.band_hz[1])
    for _ in range(ROUNDS):
        before = springs
        motions = _swings(_poles(m, before, ports), force_n, config.hammer.pulse_ms / 1e3, step_s)
        springs = _nearest(stated, config.law, own, motions)
        if np.allclose(springs.stiffness, before.stiffness, rtol=SETTLED, atol=0.0):
            break
    return springs


def _nearest(
    stated: Elasticity, laws: Sequence[LawTable], own: Sequence[int],
    motions: tuple[np.ndarray, np.ndarray],
) -> Elasticity:  # fmt: skip
    """Springs (n, e) along swings and speeds (n, laws, h, T)."""
    swing, speed = motions
    stiffness = np.tile(stated.stiffness, (len(swing), 1))
    damping = np.tile(stated.damping, (len(swing), 1))
    for j, (law, spring) in enumerate(zip(laws, own, strict=True)):
        share, damper_s = linear_of(law, swing[:, j], speed[:, j])
        stiffness[:, spring] += law.k * (share - law.in_spring)
        damping[:, spring] += law.k * (damper_s - law.in_damper_s)
    if not np.all(stiffness > 0):
        raise InputError("A joint has no stiffness left at this force; state a smaller one.")
    return Elasticity(stiffness, np.maximum(damping, 0.0), stated.loss_factor)


def linear_of(law: LawTable, swing: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Spring (n,) and damper (n,) in s, in shares of k, that come nearest to a law's torque.

    Along swings (n, h, T) in rad (m) from rest, and speeds in rad/s.
    """
    torque, state, before = np.zeros_like(swing), *np.zeros((2, *swing.shape[:2]))
    for i in range(swing.shape[2]):
        state = law.step(state, before, swing[..., i], np.array(law.a))
        torque[..., i], before = state, swing[..., i]
    both = np.stack([swing, speed], axis=1).reshape(len(swing), 2, -1)
    size = np.linalg.norm(both, axis=2, keepdims=True) + np.finfo(float).tiny
    both = both / size
    gram = both @ np.swapaxes(both, 1, 2)
    told = both @ torque.reshape(len(swing), -1, 1)
    found = (np.linalg.pinv(gram, hermitian=True) @ told / size)[..., 0]
    return found[:, 0], found[:, 1]


def _poles(m: Matrices, springs: Elasticity, seen: np.ndarray) -> Poles:
    """Of springs (n, e), seen through Jacobians (n, s, e)."""
    eye, lossy = np.eye(m.mass.shape[1]), springs.loss_factor.any()
    k = springs.stiffness * (1 + 1j * springs.loss_factor) if lossy else springs.stiffness
    c = springs.damping[:, :, None] * eye
    return solve_poles(m.mass, c, k[:, :, None] * eye + m.geometric, m.hit, seen)


def _swings(
    solved: Poles, force_n: np.ndarray, pulse_s: float, step_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Angles (n, L, h, T) in rad and speeds in rad/s of ports after hits, from the pulse's end on.

    The pulse is sin² over twice `pulse_s`, which is its impulse over its peak.
    """
    poles, length = solved.poles, 2 * pulse_s
    decay = np.min(np.maximum(-poles.real, FADED / (LONGEST * step_s)))
    t = step_s * np.arange(np.ceil(FADED / (decay * step_s)))
    turn = (2 * np.pi / length) ** 2
    given = np.expm1(poles * length) * turn / (2 * poles * (poles**2 + turn)) * force_n[:, None]
    # Of conjugate poles one is enough, and all that there is where damping is structural.
    weight = np.where(poles.imag > 0, 2.0, np.where(poles.imag < 0, 0.0, 1.0))
    sized = solved.residues * (weight * given)[..., None, None]
    course = np.exp(poles[..., None] * t)
    swing = np.einsum("nkjh,nkt->njht", sized, course, optimize=True).real
    speed = np.einsum("nkjh,nkt->njht", sized * poles[..., None, None], course, optimize=True).real
    return swing, speed
