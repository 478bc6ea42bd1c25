"""A robot whose joints are not linear, at a hit of a stated force: linearised, and in time.

Linearised: how far a joint swings after the hit says which spring and damper come nearest to its
law along that swing (least squares of the torque), and these say how far it swings: a fixed point.
Hits along different axes swing joints differently, so that each column of an FRF matrix has springs
of its own; modes are those of the three hits together.

In time: the robot without its laws is propagated pole by pole, exactly for forces and torques that
are straight between instants; the laws' torques along that motion add their own answer to its FRFs.
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
from planner.recording.points import TOOL, Layout
from planner.robot.elastic_model import Matrices
from planner.robot.joint_laws import LawTable

PER_PERIOD = 10  # instants of the highest frequency of the band
# Time constants of the slowest decay, for which a swing is followed; instants, at most.
FADED, LONGEST = 4.0, 4000
TOGETHER = 60  # poses, for which swings are held in memory
CORRECTED = 3  # times, of a torque at the end of a step
ROUNDS, SETTLED = 60, 1e-4  # of the fixed point: most, and the change of k that ends it


def accelerance_at_force(
    simulation: Simulation, q: np.ndarray, force_n: np.ndarray, frequency_hz: np.ndarray
) -> np.ndarray:
    """Accelerance (n, 3, 3, F) in m/s²/N at q (n, dof) in rad, of hits of peak force_n (n,).

    Raises InputError where a joint has no stiffness left at a force.
    """
    m, n = simulation.elastic.matrices(q), len(q)
    each = replace(m[np.repeat(np.arange(n), 3)], hit=m.hit.reshape(3 * n, 1, -1))
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


def with_possible_laws(simulation: Simulation) -> Simulation:
    """Without laws that would take away more than the spring of their joint has."""
    config, stiffness = simulation.robot.config, simulation.elasticity.stiffness
    possible = [
        law for law, spring in zip(config.law, simulation.law_springs, strict=True)
        if stiffness[spring] + law.weakest > 0
    ]  # fmt: skip
    return simulation.with_laws(possible, config.hammer)


def springs_at_force(simulation: Simulation, m: Matrices, force_n: np.ndarray) -> Elasticity:
    """Stiffness and damping (n, e) that laws come nearest to after hits of peak force_n (n,)."""
    if len(force_n) > TOGETHER:
        parts = np.array_split(np.arange(len(force_n)), -(-len(force_n) // TOGETHER))
        each = [springs_at_force(simulation, m[part], force_n[part]) for part in parts]
        stiffness = np.concatenate([one.stiffness for one in each])
        damping = np.concatenate([one.damping for one in each])
        return Elasticity(stiffness, damping, simulation.elasticity.loss_factor)
    config, each, own = simulation.robot.config, simulation.elasticity, simulation.law_springs
    stiffness, damping = (np.tile(v, (len(force_n), 1)) for v in (each.stiffness, each.damping))
    springs = stated = Elasticity(stiffness, damping, each.loss_factor)
    ports = _ports(m.mass.shape[1], own, len(force_n))
    hammer = force_n, config.hammer.pulse_ms / 1e3, 1 / (PER_PERIOD * config.band_hz[1])
    for _ in range(ROUNDS):
        before, (swing, speed) = springs, _swings(_poles(m, springs, ports), *hammer)
        stiffness, damping = stated.stiffness.copy(), stated.damping.copy()
        for j, (law, spring) in enumerate(zip(config.law, own, strict=True)):
            shares = _solved(*_products(law, swing[:, j], speed[:, j]))
            stiffness[:, spring] += law.k * (shares[:, 0] - law.in_spring)
            damping[:, spring] += law.k * (shares[:, 1] - law.in_damper_s)
        if not np.all(stiffness > 0):
            raise InputError("A joint has no stiffness left at this force; state a smaller one.")
        springs = Elasticity(stiffness, np.maximum(damping, 0.0), stated.loss_factor)
        if np.allclose(stiffness, before.stiffness, rtol=SETTLED, atol=0.0):
            break
    return springs


def with_average(
    simulation: Simulation, q: np.ndarray, axes: np.ndarray, force_n: np.ndarray
) -> Simulation:
    """The same robot, told otherwise: springs with what h hits have of the laws on average.

    Of hits at q (dof,) in rad along axes (h,) 0 to 2 of the tool, with peak force_n (h,). What laws
    do beside their springs is less then at such hits, so that an error in these matters less.
    """
    robot, count = simulation.robot, len(force_n)
    m = simulation.elastic.matrices(q)[np.zeros(count, dtype=int)]
    m = replace(m, hit=m.hit[np.arange(count), axes][:, None])
    there, stated = springs_at_force(simulation, m, force_n), simulation.elasticity
    blocks, laws, own = list(robot.config.compliance), [], simulation.law_springs
    for number, (i, law) in enumerate(zip(own, robot.config.law, strict=True)):
        laws.append(law)
        if blocks[i].tie or i in own[:number]:  # what a spring has of all its laws, the first has
            continue
        k = float(there.stiffness[:, i].mean())
        c = float(there.damping[:, i].mean())
        spring, damper = (k - stated.stiffness[i]) / law.k, (c - stated.damping[i]) / law.k
        laws[number] = msgspec.structs.replace(
            law, in_spring=law.in_spring + spring, in_damper_s=law.in_damper_s + damper
        )
        loss = blocks[i].loss_factor * blocks[i].stiffness / k
        blocks[i] = msgspec.structs.replace(blocks[i], stiffness=k, damping=c, loss_factor=loss)
    config = msgspec.structs.replace(robot.config, compliance=tuple(blocks), law=tuple(laws))
    return Simulation(replace(robot, config=config))


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
    t = step_s * np.arange(np.ceil(_fading_s(poles, step_s) / step_s))
    turn = (2 * np.pi / length) ** 2
    given = np.expm1(poles * length) * turn / (2 * poles * (poles**2 + turn)) * force_n[:, None]
    sized = solved.residues * (_one_of_pairs(poles) * given)[..., None, None]
    course = np.exp(poles[..., None] * t)
    swing = np.einsum("nkjh,nkt->njht", sized, course, optimize=True).real
    speed = np.einsum("nkjh,nkt->njht", sized * poles[..., None, None], course, optimize=True).real
    return swing, speed


def _fading_s(poles: np.ndarray, step_s: float) -> float:
    """How long the slowest decay of poles (n, 2e) is followed."""
    return float(FADED / np.min(np.maximum(-poles.real, FADED / (LONGEST * step_s))))


def _one_of_pairs(poles: np.ndarray) -> np.ndarray:
    """Weights of poles: of conjugate ones one is enough, and all that there is where damping is
    structural."""
    return np.where(poles.imag > 0, 2.0, np.where(poles.imag < 0, 0.0, 1.0))


def _ports(size: int, own: Sequence[int], count: int) -> np.ndarray:
    """Jacobians (count, L, size) of springs themselves, the same at each pose."""
    return np.broadcast_to(np.eye(size)[list(own)], (count, len(own), size))


def change_at_force(
    simulation: Simulation, q: np.ndarray, force_n: np.ndarray, frequency_hz: np.ndarray,
    in_time: bool = True,
) -> np.ndarray:  # fmt: skip
    """By how much (n, 3, 3, F) the accelerance is another than that of springs as stated.

    `in_time` as hits of peak force_n (n,) would measure it, else linearised. 0 where no force is
    stated (NaN), or the robot has no laws. Raises as `accelerance_at_force`.
    """
    change = np.zeros((len(q), 3, 3, len(frequency_hz)), dtype=complex)
    known = np.flatnonzero(np.isfinite(force_n))
    if known.size and simulation.robot.config.law:
        of = measured_at_force if in_time else accelerance_at_force
        there = of(simulation, q[known], force_n[known], frequency_hz)
        change[known] = there - simulation.accelerance(q[known], frequency_hz)
    return change


def measured_at_force(
    simulation: Simulation, q: np.ndarray, force_n: np.ndarray, frequency_hz: np.ndarray,
    layout: Layout = TOOL,
) -> np.ndarray:  # fmt: skip
    """Accelerance (n, 3s, 3, F) in m/s²/N at q (n, dof) in rad, by hits of peak force_n (n,).

    Of the hit point and the sensors of a layout.
    """
    config, m = simulation.robot.config, simulation.elastic.matrices(q, layout=layout)
    ports = _ports(m.mass.shape[1], simulation.law_springs, len(q))
    rows = (np.concatenate([one, ports], axis=1) for one in (m.hit, m.sensor))
    base = _without_laws(simulation).solved(replace(m, hit=next(rows), sensor=next(rows)))
    step_s = 1 / (PER_PERIOD * config.band_hz[1])
    torque, pulse = _marched(simulation, base, force_n, step_s)
    *torques, force = _spectrum([*torque.reshape(-1, len(pulse)), pulse], frequency_hz, step_s)
    shares = np.reshape(torques, (*torque.shape[:-1], -1)) / force / force_n[:, None, None, None]
    whole = accelerance(base, frequency_hz)
    answers = whole[:, : m.sensor.shape[1]]
    return answers[:, :, :3] - np.einsum("nslf,nlhf->nshf", answers[:, :, 3:], shares)


def _without_laws(simulation: Simulation) -> Simulation:
    """The springs and dampers beside the laws."""
    e = simulation.elasticity
    stiffness, damping = e.stiffness.copy(), e.damping.copy()
    for law, spring in zip(simulation.robot.config.law, simulation.law_springs, strict=True):
        stiffness[spring] -= law.k * law.in_spring
        damping[spring] -= law.k * law.in_damper_s
    return simulation.changed(Elasticity(stiffness, np.maximum(damping, 0.0), e.loss_factor))


def _marched(
    simulation: Simulation, base: Poles, force_n: np.ndarray, step_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Torques (n, L, 3, T) of L laws after hits from rest, and the pulse (T,) of peak 1.

    The pulse is sin² over twice the hammer's `pulse_ms`, which is its impulse over its peak.
    """
    laws, length_s = simulation.robot.config.law, 2e-3 * simulation.robot.config.hammer.pulse_ms
    poles = base.poles
    t = step_s * np.arange(np.ceil((length_s + _fading_s(poles, step_s)) / step_s))
    pulse = np.where(t < length_s, np.sin(np.pi * t / length_s) ** 2, 0.0)
    # By hits, then by torques.
    felt = base.residues[:, :, -len(laws) :] * _one_of_pairs(poles)[..., None, None]
    z = (poles * step_s)[..., None, None]
    grow, newer = np.exp(z), step_s * (np.expm1(z) - z) / z**2
    older = step_s * (1 + np.exp(z) * (z - 1)) / z**2
    gives = np.sum(newer * felt[..., 3:], axis=1).real
    sizes = np.array([law.k for law in laws])[:, None]
    struck, turned = np.zeros((2, *poles.shape, len(laws), 3), dtype=complex)
    torque, before, states = np.zeros((3, len(poles), len(laws), 3))
    out = np.zeros((len(t), *torque.shape))
    for i in range(1, len(t)):
        struck = grow * struck + older * pulse[i - 1] + newer * pulse[i]
        turned = grow * turned + older * torque[:, None]
        free = force_n[:, None, None] * np.sum(felt[..., :3] * struck, axis=1).real
        free -= np.einsum("nkjl,nklh->njh", felt[..., 3:], turned).real
        now = free
        for _ in range(CORRECTED):
            now = free - gives @ torque
            each = [law.step(states[:, j], before[:, j], now[:, j], np.array(law.a))
                    for j, law in enumerate(laws)]  # fmt: skip
            torque = sizes * np.stack(each, axis=1)
        turned += newer * torque[:, None]
        out[i], before, states = torque, now, torque / sizes
    return np.moveaxis(out, 0, -1), pulse


def _spectrum(courses: Sequence[np.ndarray], frequency_hz: np.ndarray, step_s: float) -> np.ndarray:
    """(n, F) of courses (n, T) that begin at 0 and stay as they end."""
    values = np.array(courses)
    iw, t = 2j * np.pi * frequency_hz, step_s * np.arange(values.shape[-1])
    end = np.exp(-iw * t[-1]) * (1 / iw - step_s / 2)
    return step_s * values @ np.exp(-iw * t[:, None]) + values[:, -1:] * end
