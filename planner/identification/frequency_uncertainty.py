"""What an identification's uncertainty means for natural frequencies elsewhere."""

import numpy as np

from planner.dynamics.mode_families import undamped_modes
from planner.dynamics.simulation import Simulation
from planner.identification.parameters import Parametrisation, Priors, parametrise
from planner.identification.result import Identification


def frequency_sensitivity(
    identified: Identification, nominal: Simulation, priors: Priors, q: np.ndarray, count: int
) -> np.ndarray:
    """∂ ln f of the `count` lowest oscillatory modes (n, count, P + R) at q (n, dof) in rad.

    As if they were undamped, by the parameters in the order of `identified.mean`: with
    mass-normalised shapes φ, ∂ω²/∂k = φ² and ∂ω²/∂M = −ω² φφᵀ (Fox & Kapoor 1968). The sag under
    gravity is held where the identified springs carry the weight, as it is while they are
    identified.
    """
    p = parametrise(nominal, priors if identified.nuisances else Priors())
    return log_frequency_slope(identified.simulation, p, q, count)


def log_frequency_slope(
    simulation: Simulation, parametrisation: Parametrisation, q: np.ndarray, count: int
) -> np.ndarray:
    """The same (n, count, P + R) of a simulation, by any parameters."""
    m = simulation.elastic.matrices(q)
    stiffness = simulation.stiffness.real
    hertz, shapes, _ = undamped_modes(m.mass, stiffness + m.geometric)
    chosen = _oscillatory(simulation, hertz, shapes, count)
    square = (2 * np.pi * np.take_along_axis(hertz, chosen, axis=1)) ** 2
    phi = np.take_along_axis(shapes, chosen[:, None, :], axis=2)
    springs = np.diagonal(stiffness)[None, :, None] * phi**2 / (2 * square[:, None, :])
    own = len(parametrisation.parameters)
    out = np.zeros((len(q), count, own + len(parametrisation.nuisances)))
    for p, parameter in enumerate(parametrisation.parameters):
        if parameter.kind == "stiffness":
            out[:, :, p] = springs[:, list(parameter.blocks)].sum(axis=1)
    if parametrisation.nuisances:
        basis = parametrisation.basis
        moved = np.einsum(
            "nbie,nek->nbik", simulation.elastic.body_jacobians(q), phi, optimize=True
        )
        half = np.einsum("bpij,nbjk->nbpik", basis, moved, optimize=True)
        inertial = -0.5 * np.einsum("nbik,nbpik->nkbp", moved, half, optimize=True)
        out[:, :, own:] = inertial.reshape(len(q), count, -1)
    return out


def _oscillatory(
    simulation: Simulation, hertz: np.ndarray, shapes: np.ndarray, count: int
) -> np.ndarray:
    """Columns (n, count) of the lowest undamped modes that their damping lets swing.

    Overdamped ones come last: `Simulation.modes` does not count them, and what they leave open is
    no frequency's.
    """
    damping, omega = np.diagonal(simulation.damping), np.maximum(2 * np.pi * hertz, 1e-9)
    ratio = np.einsum("e,nek->nk", damping, shapes**2) / (2 * omega)
    return np.argsort(ratio >= 1, axis=1, kind="stable")[:, :count]


def frequency_sd(
    identified: Identification, nominal: Simulation, priors: Priors, q: np.ndarray, count: int
) -> np.ndarray:
    """Standard deviation of ln f (n, count) that the parameters' covariance leaves, linearised."""
    slope = frequency_sensitivity(identified, nominal, priors, q, count)
    root = np.linalg.cholesky(identified.covariance + 1e-12 * np.eye(len(identified.mean)))
    return np.sqrt(np.sum((slope @ root) ** 2, axis=-1))
