"""What an identification found, and what the data could not tell."""

from dataclasses import dataclass

import numpy as np

from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Parametrisation

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


def estimates(
    parametrisation: Parametrisation, mean: np.ndarray, covariance: np.ndarray
) -> tuple[Estimate, ...]:
    """Marginal estimates of the springs' parameters."""
    sd = np.sqrt(np.diagonal(covariance))
    return tuple(
        Estimate(
            p.name,
            p.kind,
            p.blocks,
            float(np.exp(mean[i])),
            float(sd[i]),
            p.median,
            p.log_sd,
            p.unit,
        )
        for i, p in enumerate(parametrisation.parameters)
    )


def undetermined(parametrisation: Parametrisation, covariance: np.ndarray) -> tuple[str, ...]:
    """Directions of the springs' parameters of which the data told little, least told first.

    They are the directions in which the posterior's variance exceeds TOLD² of the prior's.
    """
    sd, names = parametrisation.log_sd, [p.name for p in parametrisation.parameters]
    count = len(names)
    root = np.linalg.cholesky(parametrisation.covariance)
    half = np.linalg.solve(root, covariance[:count, :count])
    values, vectors = np.linalg.eigh(np.linalg.solve(root, half.T))
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
