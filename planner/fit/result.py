"""What an identification found, and what the data could not tell."""

from dataclasses import dataclass

import numpy as np

from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Parametrisation, parametrise
from planner.fit.departures import departed
from planner.fit.posterior import RobotPosterior
from planner.inference.covariance import eigen
from planner.measurement.agreement import MODEL_ERROR

# The data have told something of a direction once its sd is half of what it was before.
TOLD = 0.5
SHOWN = 0.35  # least share of a parameter in a direction that is worth its name
NAMED = 4  # parameters that one sentence names at most


@dataclass(frozen=True)
class Estimate:
    """One parameter: value, the sd of its logarithm, and what was known before.

    `blocks` are the [[compliance]] blocks that share it, from 0. `identifiable`: the data at
    least halved the sd of its logarithm, and it is near what is stated (`explained`).
    """

    name: str
    kind: str
    blocks: tuple[int, ...]
    value: float
    log_sd: float
    prior_median: float
    prior_log_sd: float
    unit: str = ""
    explained: bool = True

    @property
    def sd(self) -> float:
        """Standard deviation in the parameter's unit, for small ones; the factor is e^log_sd."""
        return self.value * self.log_sd

    @property
    def identifiable(self) -> bool:
        """Whether the data say more than the prior did."""
        return self.explained and self.log_sd < TOLD * self.prior_log_sd


@dataclass(frozen=True, eq=False)
class Identification:
    """Result of `identify`.

    `covariance` (P, P) is that of the parameters' logarithms; `misfit` is χ² per real value, 1 at
    the noise.
    """

    simulation: Simulation
    estimates: tuple[Estimate, ...]
    covariance: np.ndarray
    misfit: float
    misfit_by_pose: np.ndarray  # (n,)
    undetermined: tuple[str, ...]
    converged: bool

    def estimate(self, name: str) -> Estimate:
        """The parameter of a name; KeyError if there is none."""
        return {e.name: e for e in self.estimates}[name]


def as_identification(posterior: RobotPosterior) -> Identification:
    """Of the springs of the structure that was found, those that its effects brought among them.

    An added mass is inertia of its body; effects' other numbers are held where they were found, and
    what else is known is as unsure as they make it. Where nothing explains the FRFs, no parameter
    counts as known.
    """
    structure, library = posterior.structure, posterior.structure.prior.effect_library
    simulation, names = posterior.simulation, {p.name for p in posterior.structure.parameters}
    bounds = {n: b for n, b in library.priors.bounds.items() if n in names}
    p = parametrise(Simulation(simulation.robot), library.priors_with(bounds))
    turned = _logarithms(posterior, p)
    values, covariance = np.exp(turned @ posterior.x), turned @ posterior.covariance @ turned.T
    prior = turned @ np.linalg.inv(structure.precision) @ turned.T
    sd, before = np.sqrt(np.diagonal(covariance)), np.sqrt(np.diagonal(prior))
    doubted = {structure.names[i] for i in departed(structure, posterior.x)}
    estimates = tuple(
        Estimate(
            one.name,
            one.kind,
            one.blocks,
            float(values[i]),
            float(sd[i]),
            one.median,
            float(before[i]),
            one.unit,
            posterior.explains and one.name not in doubted,
        )
        for i, one in enumerate(p.parameters)
    )
    left, converged = undetermined(p, covariance), posterior.found.settled
    misfits = posterior.misfits(MODEL_ERROR)
    return Identification(simulation, estimates, covariance, *misfits, left, converged)


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


def undetermined(parametrisation: Parametrisation, covariance: np.ndarray) -> tuple[str, ...]:
    """Directions of the springs' parameters of which the data told little, least told first.

    They are the directions in which the posterior's variance exceeds TOLD² of the prior's.
    """
    sd, names = parametrisation.log_sd, [p.name for p in parametrisation.parameters]
    count = len(names)
    root = np.linalg.cholesky(parametrisation.covariance)
    half = np.linalg.solve(root, covariance[:count, :count])
    values, vectors = eigen(np.linalg.solve(root, half.T))
    found = []
    for value, along in sorted(zip(values, vectors.T, strict=True), key=lambda v: -v[0]):
        if value > TOLD**2:
            ratio, vector = float(np.sqrt(value)), root @ along / sd
            vector = vector / np.linalg.norm(vector)
            found.append(_words(names, vector, ratio))
    return tuple(found)


def _words(names: list[str], vector: np.ndarray, ratio: float) -> str:
    by_share = np.argsort(-np.abs(vector))
    # Where many have a small share, those with the largest stand for all.
    order = [i for i in by_share if abs(vector[i]) > SHOWN][:NAMED] or list(by_share[:NAMED])
    left = f"{100 * min(ratio, 1.0):.0f} % of the prior's spread is left"
    if len(order) == 1:
        return f"The {names[order[0]]} is not determined: {left}."
    same, other = (
        " and ".join(names[i] for i in order if sign * vector[i] * vector[order[0]] > 0)
        for sign in (1, -1)
    )
    if not other:
        return f"The product of {same} is not determined: {left}."
    return f"The ratio of {same} to {other} is not determined: {left}."
