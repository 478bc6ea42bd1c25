"""Rotations at the tip from the robot's simulation, where only motions were measured there.

With G the simulation's receptances and H the measured or predicted ones from force to motion, all
six by six are taken as G + Θ (H − G) Θᵀ, where Θ = G_6h G_sh⁻¹ says how the tip turns as it moves:
exact where the simulation is, and H itself for the motions. Near antiresonances of G the inverse
would blow up what H and G differ by: it is regularised.
"""

import numpy as np

from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import receptance, solve_poles
from planner.milling.coupling import TipReceptance
from planner.milling.tip_files import TipMotion

# Of G's largest singular value at a line: what is smaller tells no rotation. Where H and G differ
# by 1 % of that value, so do rotations by at most 1 % / (2 · 0.05) of theirs.
LEAST = 0.05
# Relative sd of the simulation's rotations: links and flange that it takes for rigid bend too.
ROTATIONS_SD = 0.1


def completed(motion: TipMotion, simulation: Simulation, q: np.ndarray) -> TipReceptance:
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
    relative = np.hypot(ROTATIONS_SD, off)
    spread = relative[:, None, None] * np.abs(g)
    apart = np.abs(g[:, :3, :3] - seen[:, :, :3])  # sensor and tcp are not at the same place
    spread[:, :3, :3] = off[:, None, None] * apart
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
    ridge = (LEAST * largest)[:, None, None] ** 2 * np.eye(g.shape[-1])
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
