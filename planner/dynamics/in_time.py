"""What a hit of a stated force would measure on a robot whose joints are not linear, in time.

The robot without its laws is propagated pole by pole, exactly for forces and torques that are
straight between instants; the laws' torques along that motion add their own answer to its FRFs.
"""

from dataclasses import replace

import numpy as np

from planner.dynamics.at_force import FADED, LONGEST, PER_PERIOD, accelerance_at_force
from planner.dynamics.simulation import Elasticity, Simulation
from planner.dynamics.vibration import Poles, accelerance

CORRECTED = 3  # times, of a torque at the end of a step


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
    simulation: Simulation, q: np.ndarray, force_n: np.ndarray, frequency_hz: np.ndarray
) -> np.ndarray:
    """Accelerance (n, 3, 3, F) in m/s²/N at q (n, dof) in rad, by hits of peak force_n (n,)."""
    config, m = simulation.robot.config, simulation.elastic.matrices(q)
    own = [simulation.elastic.own_spring(law.joint) for law in config.law]
    ports = np.broadcast_to(np.eye(m.mass.shape[1])[own], (len(q), len(own), m.mass.shape[1]))
    rows = (np.concatenate([one, ports], axis=1) for one in (m.hit, m.sensor))
    base = _without_laws(simulation, own).solved(replace(m, hit=next(rows), sensor=next(rows)))
    step_s = 1 / (PER_PERIOD * config.band_hz[1])
    torque, pulse = _marched(simulation, base, force_n, step_s)
    force = force_n[:, None] * _spectrum(pulse, frequency_hz, step_s)
    shares = _spectrum(torque, frequency_hz, step_s) / force[:, None, None]
    whole = accelerance(base, frequency_hz)
    return whole[:, :3, :3] - np.einsum("nslf,nlhf->nshf", whole[:, :3, 3:], shares)


def _without_laws(simulation: Simulation, own: list[int]) -> Simulation:
    """The springs and dampers beside the laws."""
    e = simulation.elasticity
    stiffness, damping = e.stiffness.copy(), e.damping.copy()
    for law, spring in zip(simulation.robot.config.law, own, strict=True):
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
    decay = np.min(np.maximum(-poles.real, FADED / (LONGEST * step_s)))
    t = step_s * np.arange(np.ceil((length_s + FADED / decay) / step_s))
    pulse = np.where(t < length_s, np.sin(np.pi * t / length_s) ** 2, 0.0)
    # Of conjugate poles one is enough, and all that there is where damping is structural.
    weight = np.where(poles.imag > 0, 2.0, np.where(poles.imag < 0, 0.0, 1.0))
    felt = base.residues[:, :, 3:] * weight[..., None, None]  # by hits, then by torques
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


def _spectrum(values: np.ndarray, frequency_hz: np.ndarray, step_s: float) -> np.ndarray:
    """(…, F) of values (…, T) that begin at 0 and stay as they end."""
    iw, t = 2j * np.pi * frequency_hz, step_s * np.arange(values.shape[-1])
    end = np.exp(-iw * t[-1]) * (1 / iw - step_s / 2)
    return step_s * values @ np.exp(-iw * t[:, None]) + values[..., -1:] * end
