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
from planner.robot.elastic_model import Matrices

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
    """Poles (n, 2e) of n poses, residues (n, 2e, 6, 6): forces, moments to motion, turning.

    `matrices` are those of the poses.
    """

    simulation: Simulation
    matrices: Matrices
    poles: np.ndarray
    residues: np.ndarray

    @classmethod
    def of(cls, simulation: Simulation, q: np.ndarray, sloped: bool = False) -> "SolvedPoses":
        """At q (n, dof) in rad; `sloped`: for visits, whose readbacks may err."""
        elastic = simulation.elastic
        m = elastic.with_slopes(q) if sloped else elastic.matrices(q)
        stiffness = simulation.stiffness + m.geometric
        hit = np.concatenate([m.hit, m.hit_turn], axis=1)
        sensor = np.concatenate([m.sensor, m.sensor_turn], axis=1)
        solved = solve_poles(m.mass, simulation.damping, stiffness, hit, sensor)
        return cls(simulation, m, solved.poles, solved.residues)

    def response(self, pose: int, lines: Lines) -> np.ndarray:
        """(6, 6, F) at one of the poses, as records that end would show it."""
        columns = unit(lines, self.poles[pose])
        flat = self.residues[pose].reshape(len(columns), -1)
        return (flat.T @ columns).reshape(6, 6, -1)

    def misses(self, pose: int, lines: Lines, t: Tolerances) -> np.ndarray:
        """(3, 4, 3, F): `SimulatedVisit.misses` alone, of an exact chain."""
        h = self.response(pose, lines)
        return hit_basis(h[None, :3, :3], h[None, :3, 3:], t)[0]


@dataclass(frozen=True, eq=False)
class SimulatedPoses:
    """All that `visit` needs of n poses."""

    solved: SolvedPoses
    parametrisation: Parametrisation
    inertias: Inertias | None

    @classmethod
    def of(cls, simulation: Simulation, p: Parametrisation, q: np.ndarray) -> "SimulatedPoses":
        """At q (n, dof) in rad."""
        bodies = simulation.elastic.body_jacobians(q) if p.nuisances else None
        inertias = None if bodies is None else p.inertias(bodies)
        return cls(SolvedPoses.of(simulation, q, sloped=True), p, inertias)

    def visit(self, pose: int, lines: Lines, t: Tolerances, chain: np.ndarray) -> SimulatedVisit:
        """At lines of the s-plane, where the chain errs by `chain` (14,)."""
        whole = self.solved.response(pose, lines)
        h, moment, turning = whole[:3, :3], whole[:3, 3:], whole[3:, :3]
        poles, residues = self.solved.poles[pose], self.solved.residues[pose, :, :3, :3]
        slope, by_angle = self._slopes(pose, lines.x)
        off = np.broadcast_to(t.joint_rad, len(by_angle))
        exact = SimulatedVisit(
            h,
            hit_basis(h[None], moment[None], t)[0],
            chain_basis(h[None], turning[None], lines.x[None], t)[0],
            off[:, None, None, None] * by_angle,
            _discrepancy(poles, residues, lines, h),
            slope,
        )
        return _heard(exact, chain, lines.x, t)

    def _slopes(self, pose: int, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """By the parameters (P + R, 3, 3, F), and by the joint angles (dof, 3, 3, F)."""
        one, p, bodies = slice(pose, pose + 1), self.parametrisation, self.inertias
        if bodies is not None:
            bodies = Inertias(bodies.jacobians[one], bodies.basis)
        springs = self.solved.simulation.elasticity
        _, full, turned = response_parts(
            self.solved.matrices.at(one), springs, s[None], None, bodies
        )
        springs_first = full[0].reshape(full.shape[1], -1)
        by_spring = (p.spread.T @ springs_first[: len(p.held)]).reshape(-1, *full.shape[2:])
        assert turned.by_angle is not None
        return np.concatenate([by_spring, full[0, len(p.held) :]]), turned.by_angle[0]


def _heard(made: SimulatedVisit, chain: np.ndarray, s: np.ndarray, t: Tolerances) -> SimulatedVisit:
    """What a chain that errs by `chain` (14,), in prior sds, makes of what an exact one shows."""
    within = np.full((3, 3), t.across) + (t.gain - t.across) * np.eye(3)
    matrix = np.eye(3) + within * chain[:9].reshape(3, 3)
    force, late = 1 + t.force_gain * chain[12], np.exp(-t.delay_s * chain[13] * s)

    def seen(columns: np.ndarray) -> np.ndarray:
        flat = matrix @ columns.reshape(*columns.shape[:-2], -1)
        return force * late * flat.reshape(columns.shape)

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
