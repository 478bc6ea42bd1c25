"""Rotations at the tip: from two points of the tested tool, or from the robot's simulation.

Finite differences of two points (Duarte and Ewins, Mech. Syst. Signal Process. 14, 2000; Lei et
al. 2023, appendix A) take the tool between them for rigid. With C the tip's receptances and the
tool's own transfer from the tip to the other point, u' = T_uu u + T_uf f, reciprocity of that piece
gives, without that assumption, all that is measured as V C Vᵀ + W.

Where only motions were measured, with G the simulation's receptances and H the measured ones from
force to motion, all six by six are taken as G + Θ (H − G) Θᵀ, where Θ = G_6h G_sh⁻¹ says how the
tip turns as it moves: exact where the simulation is, and H itself for the motions. Near
antiresonances of G the inverse would blow up what H and G differ by: it is regularised.
"""

from dataclasses import dataclass

import numpy as np

from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import receptance, solve_poles
from planner.errors import InputError
from planner.milling.coupling import TipReceptance
from planner.milling.cutter_frf import CutterFrf
from planner.milling.tool import Point, Tool
from planner.recording.records import AXES


@dataclass(frozen=True, eq=False)
class TwoPoints:
    """Receptances (m/N) between all directions of two points, the tip's first.

    `directions` are those measured at each (numbers of x, y, z in the FRFs' axes, d of them);
    `values` and `sd` (2d, 2d, F), response by hit, the tip's d directions first. Where they err
    together `errors` (D, 2d, 2d, F) says how, as in `TipReceptance`.
    """

    frequency_hz: np.ndarray
    directions: tuple[int, ...]
    values: np.ndarray
    sd: np.ndarray
    errors: np.ndarray | None = None


def two_point_receptance(seen: TwoPoints, tool: Tool, back: Point) -> TipReceptance:
    """All receptances of the tip but those of twisting, from two points of a tool.

    `back` is the second point. Raises InputError where the directions measured are too few.
    """
    _check(seen, tool)
    omega = 2 * np.pi * seen.frequency_hz
    both = np.kron(np.eye(2), tool.frame)  # columns are the tool's axes at both points
    full = [3 * point + k for point in (0, 1) for k in seen.directions]
    values, variance = (np.zeros((len(omega), 6, 6), kind) for kind in (complex, float))
    grid = np.ix_(range(len(omega)), full, full)
    values[grid] = np.moveaxis(seen.values, -1, 0)
    variance[grid] = np.moveaxis(seen.sd, -1, 0) ** 2
    axial = len(seen.directions) == 3
    use = [0, 1, 2, 3, 4] if axial else [0, 1, 3, 4]
    kept = (0, 1, 2, 3, 4) if axial else (0, 1, 3, 4)
    here = np.ix_(range(len(omega)), use, use)
    measured = (both.T @ values @ both)[here]
    sd = np.sqrt((both.T**2 @ variance @ both**2)[here])
    together = None
    if seen.errors is not None:
        each = np.zeros((len(seen.errors), len(omega), 6, 6), complex)
        each[np.ix_(range(len(each)), range(len(omega)), full, full)] = np.moveaxis(
            seen.errors, -1, 1
        )
        together = (both.T @ each @ both)[(slice(None), *here)]
    v, w = _mapping(tool, back.from_tip_m, kept, omega)
    left = np.linalg.inv(v)
    right = np.swapaxes(left, 1, 2)
    c = left @ (measured - w) @ right
    spread = np.zeros(c.shape)
    if back.place_sd_m > 0:
        moved, shift = _mapping(tool, back.from_tip_m + back.place_sd_m, kept, omega)
        other = np.linalg.inv(moved)
        spread = np.abs(other @ (measured - shift) @ np.swapaxes(other, 1, 2) - c)
    offset = -left @ w @ right
    return TipReceptance(
        seen.frequency_hz, kept, measured, sd, left, right, offset, spread, tool.frame,
        errors=together,
    )  # fmt: skip


def _check(seen: TwoPoints, tool: Tool) -> None:
    if len(seen.directions) == 3:
        return
    along = int(np.argmax(np.abs(tool.axis)))
    across = tuple(k for k in range(3) if k != along)
    # By how much the cosine of a tool's axis with one of the FRFs' own may lack
    if abs(tool.axis[along]) < 1 - 1e-6:
        raise InputError(
            f"The axis of {tool.name} is none of the FRFs' own; measure x, y and z at both points."
        )
    if not set(across) <= set(seen.directions):
        raise InputError(
            f"Of {tool.name} both directions across its axis are needed at both points, "
            f"{AXES[across[0]]} and {AXES[across[1]]}; measure them."
        )


def _mapping(
    tool: Tool, distance: float, kept: tuple[int, ...], omega: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """V (F, k, k) and W (F, k, k) of measured = V C Vᵀ + W, in the tool's own axes."""
    piece, lines = tool.above(distance).transfer(omega), range(len(omega))
    uu = piece[np.ix_(lines, (0, 1), kept)]
    uf = piece[np.ix_(lines, (0, 1), [6 + k for k in kept])]
    d, size = len(kept) - 2, len(kept)
    v = np.zeros((len(omega), size, size), complex)
    v[:, range(d), range(d)] = 1
    v[:, d:] = uu
    w = np.zeros(v.shape, complex)
    w[:, d:, :d] = uf[:, :, :d]
    w[:, :d, d:] = np.swapaxes(uf[:, :, :d], 1, 2)
    w[:, d:, d:] = uf @ np.swapaxes(uu, 1, 2)
    return v, w


def completed(motion: CutterFrf, simulation: Simulation, q: np.ndarray) -> TipReceptance:
    """All receptances of the tcp at q (dof,) in rad, from those of motion and a simulation."""
    g, seen = _simulated(simulation, q, motion.frequency_hz)
    own = np.moveaxis(motion.receptance, -1, 0)
    least = regularised_inverse(seen[:, :, :3])
    left = np.zeros((len(own), 6, 3), complex)
    left[:, :3] = np.eye(3)
    left[:, :3] += (g[:, :3, :3] - seen[:, :, :3]) @ least
    left[:, 3:] = g[:, 3:, :3] @ least
    right = np.zeros((len(own), 3, 6), complex)
    right[:, :, :3] = np.eye(3)
    right[:, :, 3:] = least @ seen[:, :, 3:]
    # A simulation that misses the motions misses the rotations too, by as much at least.
    off = np.linalg.norm(own - seen[:, :, :3], axis=(1, 2)) / np.linalg.norm(own, axis=(1, 2))
    # Relative sd of the simulation's rotations: links and flange that it takes for rigid bend too.
    relative = np.hypot(0.1, off)
    spread = relative[:, None, None] * np.abs(g)
    apart = np.abs(g[:, :3, :3] - seen[:, :, :3])  # sensor and tcp are not at the same place
    spread[:, :3, :3] = off[:, None, None] * apart
    assert motion.sd is not None
    return TipReceptance(
        motion.frequency_hz,
        tuple(range(6)),
        own,
        np.moveaxis(motion.sd, -1, 0),
        left,
        right,
        g - left @ seen[:, :, :3] @ right,
        spread,
        remarks=(
            "The robot turns at its tcp as its simulation does, bodies between joints rigid; "
            f"these rotations count with an sd of {100 * np.median(relative):.0f} % (median over "
            f"the lines).",
        ),
    )


def regularised_inverse(g: np.ndarray) -> np.ndarray:
    """(F, n, n) of matrices: their inverse, but for what is small beside their largest part."""
    largest = np.linalg.norm(g, 2, axis=(1, 2))
    conjugate = np.conj(np.swapaxes(g, 1, 2))
    # Of G's largest singular value at a line: what is smaller tells no rotation. Where H and G
    # differ by 1 % of that value, so do rotations by at most 1 % / (2 · 0.05) of theirs.
    ridge = (0.05 * largest)[:, None, None] ** 2 * np.eye(g.shape[-1])
    return conjugate @ np.linalg.inv(g @ conjugate + ridge)


def _simulated(
    simulation: Simulation, q: np.ndarray, frequency_hz: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Receptances of the tcp (F, 6, 6), and of the sensor's motion from the tcp (F, 3, 6)."""
    m = simulation.elastic.matrices(q)
    tip = np.concatenate([m.hit, m.hit_turn], axis=1)
    rows = np.concatenate([tip, m.sensor], axis=1)
    poles = solve_poles(m.mass, simulation.damping, simulation.stiffness + m.geometric, tip, rows)
    values = np.moveaxis(receptance(poles, frequency_hz)[0], -1, 0)
    return values[:, :6], values[:, 6:]
