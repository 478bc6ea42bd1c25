"""A robot whose joints are not linear, linearised for a hit of a stated force.

How far a joint swings after the hit says which spring and damper come nearest to its law along
that swing (least squares of the torque), and these say how far it swings: a fixed point. Hits along
different axes swing joints differently, so that each column of an FRF matrix has springs of its
own; modes are those of the three hits together.
"""

from collections.abc import Sequence
from dataclasses import replace

import msgspec
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
TOGETHER = 60  # poses, for which swings are held in memory
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
    if len(force_n) > TOGETHER:
        parts = np.array_split(np.arange(len(force_n)), -(-len(force_n) // TOGETHER))
        each = [springs_at_force(simulation, m.at(part), force_n[part]) for part in parts]
        stiffness = np.concatenate([one.stiffness for one in each])
        damping = np.concatenate([one.damping for one in each])
        return Elasticity(stiffness, damping, simulation.elasticity.loss_factor)
    laws = simulation.robot.config.law
    own = [simulation.elastic.own_spring(law.joint) for law in laws]
    springs = stated = _each(simulation.elasticity, len(force_n))
    for _ in range(ROUNDS):
        before, (swing, speed) = springs, _after(simulation, m, springs, own, force_n)
        stiffness, damping = stated.stiffness.copy(), stated.damping.copy()
        for j, (law, spring) in enumerate(zip(laws, own, strict=True)):
            shares = _solved(*_products(law, swing[:, j], speed[:, j]))
            stiffness[:, spring] += law.k * (shares[:, 0] - law.in_spring)
            damping[:, spring] += law.k * (shares[:, 1] - law.in_damper_s)
        if not np.all(stiffness > 0):
            raise InputError("A joint has no stiffness left at this force; state a smaller one.")
        springs = Elasticity(stiffness, np.maximum(damping, 0.0), stated.loss_factor)
        if np.allclose(stiffness, before.stiffness, rtol=SETTLED, atol=0.0):
            break
    return springs


def averaged(
    simulation: Simulation, q: np.ndarray, axes: np.ndarray, force_n: np.ndarray
) -> Simulation:
    """The same where its springs have of the laws what h hits have on average, as fits to them.

    Of hits at q (h, dof) in rad along axes (h,) 0 to 2 of the tool, with peak force_n (h,).
    """
    config, springs = simulation.robot.config, simulation.elasticity
    own = [simulation.elastic.own_spring(law.joint) for law in config.law]
    grams, products = np.zeros((len(own), 2, 2)), np.zeros((len(own), 2))
    for pose in np.unique(q, axis=0):
        here = np.flatnonzero(np.all(q == pose, axis=1))
        m = simulation.elastic.matrices(pose).at(np.zeros(len(here), dtype=int))
        m = replace(m, hit=m.hit[np.arange(len(here)), axes[here]][:, None])
        swing, speed = _after(simulation, m, _each(springs, len(here)), own, force_n[here])
        for j, law in enumerate(config.law):
            gram, product = _products(law, swing[:, j], speed[:, j])
            grams[j] += gram.sum(axis=0)
            products[j] += product.sum(axis=0)
    laws = [
        msgspec.structs.replace(law, in_spring=spring, in_damper_s=damper)
        for law, (spring, damper) in zip(config.law, _solved(grams, products).tolist(), strict=True)
    ]
    return simulation.with_laws(laws, config.hammer)


def _products(law: LawTable, swing: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of swing and speed (n, h, T) with each other (n, 2, 2), and with a law's torque (n, 2)."""
    torque, state, before = np.zeros_like(swing), *map(np.zeros, 2 * (swing.shape[:2],))
    for i in range(swing.shape[2]):
        state = law.step(state, before, swing[..., i], np.array(law.a))
        torque[..., i], before = state, swing[..., i]
    both = np.stack([swing, speed], axis=1).reshape(len(swing), 2, -1)
    flat = torque.reshape(len(swing), -1, 1)
    return both @ np.swapaxes(both, 1, 2), (both @ flat)[..., 0]


def _solved(gram: np.ndarray, product: np.ndarray) -> np.ndarray:
    """(…, 2) spring and damper (s), in shares of k, that come nearest to a law's torque."""
    size = np.sqrt(np.diagonal(gram, axis1=-2, axis2=-1)) + np.finfo(float).tiny
    scaled = gram / size[..., None] / size[..., None, :]
    return (np.linalg.pinv(scaled, hermitian=True) @ (product / size)[..., None])[..., 0] / size


def _each(springs: Elasticity, count: int) -> Elasticity:
    """For each of so many poses the same."""
    stiffness, damping = (np.tile(v, (count, 1)) for v in (springs.stiffness, springs.damping))
    return Elasticity(stiffness, damping, springs.loss_factor)


def _after(
    simulation: Simulation, m: Matrices, springs: Elasticity, own: Sequence[int],
    force_n: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Swings and speeds of springs of joints after hits, as of `_swings`."""
    config, size = simulation.robot.config, m.mass.shape[1]
    ports = np.broadcast_to(np.eye(size)[own], (len(force_n), len(own), size))
    step_s = 1 / (PER_PERIOD * config.band_hz[1])
    return _swings(_poles(m, springs, ports), force_n, config.hammer.pulse_ms / 1e3, step_s)


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
