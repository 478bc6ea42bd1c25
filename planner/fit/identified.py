"""What was found, as an identification: a simulation, its parameters and their covariance."""

from dataclasses import dataclass, replace

import numpy as np

from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Parametrisation, Priors, parametrise
from planner.fit.departures import departed
from planner.fit.posterior import RobotPosterior
from planner.fit.result import Identification, estimates, undetermined
from planner.measurement.agreement import MODEL_ERROR


@dataclass(frozen=True, eq=False)
class ExtendedModel:
    """A simulation whose parameters were identified, and what was known of them before.

    Its last `added` springs are not in robot.toml.
    """

    simulation: Simulation
    priors: Priors
    added: int = 0


def as_identification(posterior: RobotPosterior) -> tuple[ExtendedModel, Identification]:
    """The structure with what was known of it before, and what the FRFs made of it.

    An added mass is inertia of its body; effects' other numbers are held where they were found, and
    what else is known is as unsure as they make it. Where nothing explains the FRFs, no parameter
    counts as known.
    """
    structure, library = posterior.structure, posterior.structure.prior.effect_library
    simulation = posterior.simulation
    nominal = Simulation(simulation.robot)
    names = {p.name for p in structure.parameters}
    bounds = {n: b for n, b in library.priors.bounds.items() if n in names}
    model = ExtendedModel(
        nominal,
        library.priors_with(bounds),
        len(structure.springs) - library.stated,
    )
    p = parametrise(nominal, model.priors)
    turned = _logarithms(posterior, p)
    mean, covariance = turned @ posterior.x, turned @ posterior.covariance @ turned.T
    misfit, by_pose = posterior.misfits(MODEL_ERROR)
    before = np.sqrt(np.diagonal(turned @ np.linalg.inv(structure.precision) @ turned.T))
    doubted = {structure.names[i] for i in departed(structure, posterior.x)}
    told = estimates(p, mean, covariance)
    result = Identification(
        simulation,
        tuple(
            replace(
                one,
                explained=posterior.explains and one.name not in doubted,
                prior_log_sd=float(sd),
            )
            for one, sd in zip(told, before, strict=True)
        ),
        covariance,
        misfit,
        by_pose,
        undetermined(p, covariance),
        posterior.found.settled,
    )
    return model, result


def _logarithms(posterior: RobotPosterior, p: Parametrisation) -> np.ndarray:
    """(P, D): by which x is turned into the logarithms of the springs' parameters."""
    structure = posterior.structure
    turned = np.zeros((len(p.parameters), structure.size))
    by_name = {name: k for k, name in enumerate(structure.names)}
    springs = {q.name: q for q in structure.parameters}
    stiffness = [q for q in structure.parameters if q.kind == "stiffness"]
    for i, parameter in enumerate(p.parameters):
        name = parameter.name
        if name not in by_name:  # a loss factor that an effect brought
            name = next(n for n in by_name if n.startswith(f"{name} of "))
        turned[i, by_name[name]] = 1.0
        if parameter.kind == "damping":  # known by its ratio to the stiffness
            blocks = set(springs[name].blocks)
            turned[i, by_name[next(q.name for q in stiffness if blocks & set(q.blocks))]] = 1.0
    return turned
