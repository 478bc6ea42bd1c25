"""What a simulation says that the hits of one pose show, and all by which that may be off.

Each is a column of the FRF matrix, linear to first order: how hits miss, what the measuring chain
and the readback leave open, how the simulation's parameters move it, and a discrepancy of its
modes that no parameter describes.
"""

from dataclasses import dataclass

import numpy as np

from planner.dynamics.gradient import Inertias, response_parts
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import solve_poles
from planner.identification.measurement_model import Tolerances, chain_basis, hit_basis
from planner.identification.parameters import Parametrisation
from planner.modal.residues import Lines, unit, unit_slope

# Of each joint: what a robot's encoders and its geometry leave.
READBACK_DEG, READBACK_M = 0.05, 5e-4
REACH = 1.5  # highest lines: modes up to there may each be off, those above only together
# Relative error of a simulated pole, where modal shapes are off by 1: frequencies are fitted far
# better than shapes (on simulated cells shapes err by 0.1 to 1 %, poles by 0.01 to 0.1 %).
POLE_SHARE = 0.2


@dataclass(frozen=True, eq=False)
class SimulatedVisit:
    """At F lines of a pose, in m/s²/N.

    `accelerance` (3, 3, F); by unit sds `misses` (3, 4, 3, F) of a hit along each axis, `chain`
    (14, 3, 3, F), `readback` (dof, 3, 3, F); `discrepancy` (d, 3, 3, F) where shapes are off by
    their own size; `slope` (P + R, 3, 3, F) by the parameters.
    """

    accelerance: np.ndarray
    misses: np.ndarray
    chain: np.ndarray
    readback: np.ndarray
    discrepancy: np.ndarray
    slope: np.ndarray


@dataclass(frozen=True, eq=False)
class SolvedPoses:
    """Poles (n, 2e) of n poses, residues (n, 2e, 6, 6): forces, moments to motion, turning."""

    poles: np.ndarray
    residues: np.ndarray

    @classmethod
    def of(cls, simulation: Simulation, q: np.ndarray) -> "SolvedPoses":
        """At q (n, dof) in rad."""
        m = simulation.elastic.matrices(q)
        stiffness = simulation.stiffness + m.geometric
        hit = np.concatenate([m.hit, m.hit_turn], axis=1)
        sensor = np.concatenate([m.sensor, m.sensor_turn], axis=1)
        solved = solve_poles(m.mass, simulation.damping, stiffness, hit, sensor)
        return cls(solved.poles, solved.residues)

    def response(self, pose: int, lines: Lines) -> np.ndarray:
        """(6, 6, F) at one of the poses, as records that end would show it."""
        columns = unit(lines, self.poles[pose])
        flat = self.residues[pose].reshape(len(columns), -1)
        return (flat.T @ columns).reshape(6, 6, -1)


def misses_at(simulation: Simulation, q: np.ndarray, lines: Lines, t: Tolerances) -> np.ndarray:
    """(3, 4, 3, F): `SimulatedVisit.misses` alone, at q (dof,)."""
    h = SolvedPoses.of(simulation, q[None]).response(0, lines)
    return hit_basis(h[None, :3, :3], h[None, :3, 3:], t)[0]


def _heard(made: SimulatedVisit, chain: np.ndarray, s: np.ndarray, t: Tolerances) -> SimulatedVisit:
    """What a chain that errs by `chain` (14,), in prior sds, makes of what an exact one shows."""
    within = np.full((3, 3), t.across) + (t.gain - t.across) * np.eye(3)
    matrix = np.eye(3) + within * chain[:9].reshape(3, 3)
    force, late = 1 + t.force_gain * chain[12], np.exp(-t.delay_s * chain[13] * s)

    def seen(columns: np.ndarray) -> np.ndarray:
        return force * late * np.einsum("ik,...kjf->...ijf", matrix, columns)

    place = made.chain[9:12]
    moved = made.accelerance + np.einsum("k,kijf->ijf", chain[9:12], place)
    h = seen(moved)
    columns = np.zeros_like(made.chain)
    for i in range(3):
        for j in range(3):
            columns[3 * i + j, i] = within[i, j] * force * late * moved[j]
    columns[9:12], columns[12], columns[13] = (
        seen(place),
        t.force_gain / force * h,
        -t.delay_s * s * h,
    )
    misses = force * late * np.einsum("ik,alkf->alif", matrix, made.misses)
    return SimulatedVisit(
        h, misses, columns, seen(made.readback), seen(made.discrepancy), seen(made.slope)
    )


def simulated_visit(
    simulation: Simulation,
    parametrisation: Parametrisation,
    q: np.ndarray,
    lines: Lines,
    t: Tolerances,
    chain: np.ndarray,
) -> SimulatedVisit:
    """Of a pose q (dof,) in rad, at lines of the s-plane, where the chain errs by `chain` (14,)."""
    slides = simulation.robot.joints.slides
    off = np.diag(np.where(slides, READBACK_M, np.deg2rad(READBACK_DEG)))
    solved = SolvedPoses.of(simulation, np.concatenate([q[None], q + off]))
    whole = solved.response(0, lines)
    h, moment, turning = whole[:3, :3], whole[:3, 3:], whole[3:, :3]
    moved = [solved.response(1 + k, lines)[:3, :3] - h for k in range(len(q))]
    exact = SimulatedVisit(
        h,
        hit_basis(h[None], moment[None], t)[0],
        chain_basis(h[None], turning[None], lines.x[None], t)[0],
        np.array(moved),
        _discrepancy(solved.poles[0], solved.residues[0, :, :3, :3], lines, h),
        _slope(simulation, parametrisation, q, lines.x),
    )
    return _heard(exact, chain, lines.x, t)


def _slope(simulation: Simulation, p: Parametrisation, q: np.ndarray, s: np.ndarray) -> np.ndarray:
    elastic = simulation.elastic
    inertias: Inertias | None = None
    if p.nuisances:
        inertias = p.inertias(elastic.body_jacobians(q[None]))
    matrices, springs = elastic.matrices(q[None]), simulation.elasticity
    full = response_parts(matrices, springs, s[None], None, inertias)[1][0]
    by_spring = np.einsum("n...,np->p...", full[: len(p.held)], p.spread)
    return np.concatenate([by_spring, full[len(p.held) :]])


def _discrepancy(poles: np.ndarray, residue: np.ndarray, lines: Lines, h: np.ndarray) -> np.ndarray:
    """Each mode excited and seen otherwise than simulated, its pole beside; all higher modes."""
    top = np.max(np.abs(lines.x))
    own = np.flatnonzero((poles.imag > 1e-9 * np.abs(poles)) & (np.abs(poles) < REACH * top))
    pole, residue = poles[own], residue[own]
    left, size, right = np.linalg.svd(residue)
    up, down = unit(lines, pole), unit(lines, pole.conj())
    steep, flat = unit_slope(lines, pole), unit_slope(lines, pole.conj())
    out = []
    for one in (1, 1j):
        for axis in range(3):
            change = np.zeros((2, *residue.shape), dtype=complex)
            change[0, :, :, axis] = one * left[:, :, 0] * size[:, :1]
            change[1, :, axis] = one * right[:, 0] * size[:, :1]
            out += [_of(change[0], up, down), _of(change[1], up, down)]
        moved = POLE_SHARE * one * np.abs(pole)[:, None, None] * residue
        out.append(_of(moved, steep, flat))
    above = np.zeros((9, 3, 3, len(lines.x)), dtype=complex)
    level = np.sqrt(np.mean(np.abs(h) ** 2) / np.mean(np.abs(lines.x) ** 4))
    above.reshape(9, 9, -1)[np.arange(9), np.arange(9)] = level * lines.x**2
    return np.concatenate([*out, above])


def _of(residue: np.ndarray, up: np.ndarray, down: np.ndarray) -> np.ndarray:
    """(m, 3, 3, F) of m residues, each alone, with its conjugate."""
    return residue[..., None] * up[:, None, None] + residue.conj()[..., None] * down[:, None, None]
