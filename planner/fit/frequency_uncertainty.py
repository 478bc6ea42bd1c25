"""What an identification's uncertainty means for natural frequencies elsewhere."""

from dataclasses import dataclass, replace

import numpy as np

from planner.dynamics.motion import Motion
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import SimulatedModes
from planner.effects.parameters import Parametrisation
from planner.fit.misfit import FrfMisfit
from planner.fit.posterior import RobotPosterior

# A pole is told by inverse iteration from so far beside it, relative to itself, in so many rounds.
BESIDE, ROUNDS = 1e-7, 2


def log_frequency_slope(
    simulation: Simulation, parametrisation: Parametrisation, q: np.ndarray, modes: SimulatedModes
) -> np.ndarray:
    """∂ ln f of a simulation's `modes` (n, count) at q (n, dof) in rad, (n, count, P + R).

    By any parameters; 0 where there is no mode.

    With Z(λ) = λ²M + λC + K symmetric and Z(λ) x = 0, dλ = −xᵀ dZ x / xᵀ(2λM + C)x: modes are the
    damped ones, whatever the dampers. The sag under gravity is held where the springs carry the
    weight, as it is while they are identified.
    """
    poles = PoleMotion.of(simulation, q, modes)
    pole, x, scale = poles.pole, poles.shape, poles.scale
    springs, own = simulation.elasticity, len(parametrisation.parameters)
    by_kind = {
        "stiffness": np.diagonal(simulation.stiffness)[None, None],
        "damping": pole[..., None] * springs.damping,
        "loss_factor": 1j * (springs.stiffness * springs.loss_factor)[None, None],
    }
    slope = {kind: scale[..., None] * values * x**2 for kind, values in by_kind.items()}
    out = np.zeros((*pole.shape, own + len(parametrisation.nuisances)))
    for number, parameter in enumerate(parametrisation.parameters):
        some = slope[parameter.kind][..., list(parameter.blocks)]
        out[..., number] = some.sum(axis=-1).real
    if parametrisation.nuisances:
        jacobians = simulation.elastic.body_jacobians(q)
        bodies, numbers = parametrisation.basis.shape[:2]
        moved = np.moveaxis(jacobians @ np.swapaxes(x, 1, 2)[:, None], 3, 2)  # (n, b, k, 6)
        squares = (moved[..., :, None] * moved[..., None, :]).reshape(*moved.shape[:3], -1)
        basis = parametrisation.basis.reshape(bodies, numbers, -1)
        change = np.moveaxis(squares @ np.swapaxes(basis, 1, 2), 1, 2)  # (n, k, b, p)
        inertial = (scale * pole**2)[..., None, None] * change
        out[..., own:] = inertial.real.reshape(*pole.shape, -1)
    return np.where(poles.known[..., None], out, 0.0)


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


def frequency_sd(posterior: RobotPosterior, q: np.ndarray, modes: SimulatedModes) -> np.ndarray:
    """Standard deviation of ln f (n, count) that all numbers of a structure leave, linearised.

    `modes` are its simulation's at q (n, dof) in rad.
    """
    slope = structure_slope(posterior, q, modes)
    return np.sqrt(np.sum((slope @ posterior.root) ** 2, axis=-1))


def structure_slope(posterior: RobotPosterior, q: np.ndarray, modes: SimulatedModes) -> np.ndarray:
    """∂ ln f (n, count, D) of the same by the numbers of the structure, but for the chain's."""
    poles, structure = PoleMotion.of(posterior.simulation, q, modes), posterior.structure
    data = posterior.at(q, np.abs(poles.pole) / (2 * np.pi))
    data = replace(data, measured=replace(data.measured, s=poles.pole))
    x = np.swapaxes(poles.shape[..., : len(structure.springs)], 1, 2)[:, :, None]
    misfit = FrfMisfit(structure, data, posterior.tolerances)
    # Accelerances' slopes are −s² xᵀ dZ x of how hits and sensors move the springs.
    moved, _ = misfit.slopes(Motion(misfit.matrices, x, x, poles.pole), posterior.x)
    slope = (moved[:, :, 0, 0] * (-poles.scale / poles.pole**2)[:, None]).real
    return np.where(poles.known[..., None], np.swapaxes(slope, 1, 2), 0.0)
