"""What an identification's uncertainty means for natural frequencies elsewhere."""

from dataclasses import dataclass, replace

import numpy as np

from planner.dynamics.motion import Motion
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import SimulatedModes
from planner.fit.misfit import FrfMisfit
from planner.fit.posterior import RobotBelief

# A pole is told by inverse iteration from so far beside it, relative to itself, in so many rounds.
BESIDE, ROUNDS = 1e-7, 2


@dataclass(frozen=True, eq=False)
class PoleMotion:
    """Poles λ (n, count) of modes, shapes (n, count, e), and `scale`: d ln λ is it times xᵀ dZ x.

    Where there is no mode (not `known`) they mean nothing.
    """

    known: np.ndarray
    pole: np.ndarray
    shape: np.ndarray
    scale: np.ndarray

    @classmethod
    def of(cls, simulation: Simulation, q: np.ndarray, modes: SimulatedModes) -> "PoleMotion":
        """Of a simulation's `modes` at q (n, dof) in rad."""
        m, (hertz, ratio) = (
            simulation.elastic.matrices(q),
            (modes.frequency_hz, modes.damping_ratio),
        )
        known = np.isfinite(hertz)
        omega, ratio = 2 * np.pi * np.where(known, hertz, 1.0), np.where(known, ratio, 0.0)
        pole = omega * (1j * np.sqrt(np.maximum(1 - ratio**2, 0.0)) - ratio)
        stiffness = simulation.stiffness + m.geometric
        x = _shapes(m.mass, simulation.damping, stiffness, pole)
        momentum = 2 * pole[..., None] * np.einsum("nef,nkf->nke", m.mass, x)
        momentum += x @ simulation.damping
        # Of ln λ, whose real part is that of ln |λ| = ln 2πf.
        return cls(known, pole, x, -1 / (pole * np.einsum("nke,nke->nk", x, momentum)))


def _shapes(
    mass: np.ndarray, damping: np.ndarray, stiffness: np.ndarray, pole: np.ndarray
) -> np.ndarray:
    """Shapes (n, count, e) of poles (n, count), Z(λ) x = 0, by inverse iteration."""
    beside = (pole * (1 + BESIDE))[..., None, None]
    z = beside**2 * mass[:, None] + beside * damping + stiffness[:, None]
    x = np.ones((*pole.shape, mass.shape[1], 1), dtype=complex)
    for _ in range(ROUNDS):
        x = np.linalg.solve(z, x)
        x = x / np.max(np.abs(x), axis=-2, keepdims=True)
    return x[..., 0]


def frequency_sd(belief: RobotBelief, q: np.ndarray, modes: SimulatedModes) -> np.ndarray:
    """Standard deviation of ln f (n, count) that all numbers of a structure leave, linearised.

    `modes` are its simulation's at q (n, dof) in rad.
    """
    slope = log_frequency_slope(belief, q, modes)
    return np.sqrt(np.sum((slope @ belief.root) ** 2, axis=-1))


def log_frequency_slope(belief: RobotBelief, q: np.ndarray, modes: SimulatedModes) -> np.ndarray:
    """∂ ln f (n, count, D) of the same by the physical numbers of the structure.

    With Z(λ) = λ²M + λC + K symmetric and Z(λ) x = 0, dλ = −xᵀ dZ x / xᵀ(2λM + C)x: modes are the
    damped ones, whatever the dampers. The sag under gravity is held where the springs carry the
    weight, as it is while they are identified. 0 where there is no mode.
    """
    poles, structure = PoleMotion.of(belief.simulation, q, modes), belief.structure
    data = belief.at(q, np.abs(poles.pole) / (2 * np.pi))
    data = replace(data, measured=replace(data.measured, s=poles.pole))
    x = np.swapaxes(poles.shape[..., : len(structure.springs)], 1, 2)[:, :, None]
    misfit = FrfMisfit(structure, data, belief.tolerances)
    # Accelerances' slopes are −s² xᵀ dZ x of how hits and sensors move the springs.
    moved, _ = misfit.slopes(Motion(misfit.matrices, x, x, poles.pole), belief.x)
    slope = (moved[:, :, 0, 0] * (-poles.scale / poles.pole**2)[:, None]).real
    return np.where(poles.known[..., None], np.swapaxes(slope, 1, 2), 0.0)
