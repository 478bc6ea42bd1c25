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
    structure, repertoire = posterior.structure, posterior.structure.prior.repertoire
    simulation = posterior.simulation
    nominal = Simulation(simulation.robot)
    names = {p.name for p in structure.parameters}
    bounds = {n: b for n, b in repertoire.priors.bounds.items() if n in names}
    model = ExtendedModel(
        nominal,
        repertoire.priors_with(bounds),
        len(structure.springs) - repertoire.stated,
    )
    p = parametrise(nominal, model.priors)
    mean, turned = _translated(posterior, p, simulation, nominal)
    covariance = turned @ posterior.covariance @ turned.T
    covariance += np.diag(np.full(len(covariance), 1e-9))  # of bodies that nothing moves
    misfit, by_pose = posterior.misfits(MODEL_ERROR)
    before = np.sqrt(np.diagonal(turned @ np.linalg.inv(structure.precision) @ turned.T))
    doubted = {structure.names[i] for i in departed(structure, posterior.x)}
    told = estimates(p, mean[: len(p.parameters)], covariance)
    result = Identification(
        simulation,
        tuple(
            replace(
                one,
                explained=posterior.explains and one.name not in doubted,
                prior_log_sd=float(sd),
            )
            for one, sd in zip(told, before, strict=False)
        ),
        p.nuisances,
        mean,
        covariance,
        misfit,
        by_pose,
        undetermined(p, covariance),
        posterior.found.settled,
    )
    return model, result


def _translated(
    posterior: RobotPosterior, p: Parametrisation, simulation: Simulation, nominal: Simulation
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (P + R,) in its numbers, and the matrix (P + R, D) by which x moves them."""
    structure, x = posterior.structure, posterior.x
    springs, bodies = structure.parameters, structure.bodies
    count = len(p.parameters)
    turned = np.zeros((count + len(p.nuisances), structure.size))
    mean = np.zeros(len(turned))
    by_name = {name: k for k, name in enumerate(structure.names)}
    springs_named = {q.name: q for q in springs}
    stiffness = [q.name for q in springs if q.kind == "stiffness"]
    for i, parameter in enumerate(p.parameters):
        if parameter.name in by_name:
            turned[i, by_name[parameter.name]] = 1.0
            mean[i] = x[by_name[parameter.name]]
        else:  # a loss factor that an effect brought
            own = next(k for n, k in by_name.items() if n.startswith(f"{parameter.name} of "))
            turned[i, own], mean[i] = 1.0, np.log(parameter.median)
        if parameter.kind == "damping":
            blocks = set(springs_named[parameter.name].blocks)
            there = (n for n in stiffness if blocks & set(springs_named[n].blocks))
            at = by_name[next(there)]
            turned[i, at] += 1.0
            mean[i] += x[at]
    difference = simulation.elastic.inertia - nominal.elastic.inertia
    slopes = bodies.slopes(x[structure.inertial])
    per = p.inertia.shape[1]
    pairs = zip(structure.effects, structure.own, strict=True)
    added = [(own, *more) for effect, own in pairs if (more := effect.inertia(x[own]))]
    for b, name in enumerate(nominal.elastic.bodies):
        rows = slice(count + b * per, count + (b + 1) * per)
        onto = np.linalg.pinv(p.inertia[b].T)
        mean[rows] = onto @ difference[b]
        if name in bodies.bodies:
            k = bodies.bodies.index(name)
            turned[rows, structure.inertial.start + bodies.mine[k]] = onto @ slopes[k].T
        for own, body, _, moved in added:
            if body == name:
                turned[rows, own] = onto @ moved.T
    return mean, turned
