"""What is minimised in an identification, stage by stage, with all that stays the same."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from planner.dynamics.gradient import Inertias
from planner.effects.parameters import Parametrisation
from planner.errors import InputError
from planner.fit.identify import TOO_SOFT
from planner.frf.frf import Frf
from planner.identification.effort import Effort
from planner.identification.feasible_inertias import Barrier
from planner.identification.objective import Objective, stands
from planner.inference.least_squares import Minimum, minimise
from planner.measurement.agreement import MODEL_ERROR
from planner.measurement.measured_frfs import matrices_at, stack
from planner.measurement.nuisances import Tolerances
from planner.robot.elastic_model import ElasticModel, Matrices

LOG_TOLERANCE = 1e-4
STIFFER = float(np.log(1.5))  # by which the springs of a start grow until they carry the weight
STIFFEST = 20  # such steps: a factor of 3,000


@dataclass(frozen=True)
class Progress:
    """Where an identification is: start (from 1), stage in words, iteration, misfit so far."""

    start: int
    stage: str
    iteration: int
    misfit: float


@dataclass(frozen=True, eq=False)
class StagedProblem:
    """All that stays the same from start to start.

    Matrices depend on the springs only in that these carry the weight: they are those of
    robot.toml's until a search has found better ones.
    """

    frfs: tuple[Frf, ...]
    q: np.ndarray
    elastic: ElasticModel
    band_hz: tuple[float, float]
    matrices: Matrices
    inertias: Inertias
    parametrisation: Parametrisation
    progress: Callable[[Progress], None] | None
    effort: Effort
    barrier: Barrier | None
    tolerances: Tolerances | None

    @property
    def inertial(self) -> bool:
        """Whether inertias are identified too."""
        return bool(self.parametrisation.nuisances)

    def carried(self, x: np.ndarray) -> tuple["StagedProblem", np.ndarray]:
        """The same where the springs at x = (θ, φ) carry the weight, and x, made to stand there."""
        p = self.parametrisation
        count = len(p.parameters)
        elastic = self.elastic.carried_by(p.elasticity(x[:count]).stiffness)
        inertias = p.inertias(elastic.body_jacobians(self.q))
        matrices = matrices_at(elastic, self.q, self.frfs, self.tolerances is not None)
        there = replace(self, matrices=matrices, inertias=inertias)
        return there, np.concatenate([there.standing(x[:count]), x[count:]])

    def standing(self, theta: np.ndarray) -> np.ndarray:
        """θ (P,) with all springs as much stiffer as it takes to carry the robot's weight."""
        p = self.parametrisation
        stiffer = STIFFER * np.array([x.kind == "stiffness" for x in p.parameters])
        for steps in range(STIFFEST + 1):
            tried = p.near(theta + steps * stiffer) if steps else theta
            if stands(self.matrices, p.elasticity(tried).stiffness):
                return tried
        raise InputError(TOO_SOFT)

    def objective(
        self, share: float, lines: int, logarithmic: bool = False, inertia: bool = False
    ) -> Objective:
        low, high = self.band_hz
        band = low, low + share * (high - low)
        measured = stack(self.frfs, band, lines, MODEL_ERROR)
        parts = self.matrices, self.inertias, self.parametrisation
        return Objective(measured, *parts, logarithmic, inertia, barrier=self.barrier)

    def prepared(self, objective: Objective, x: np.ndarray, tail: bool) -> Objective:
        """With what the records cut off (if they have a tail) and leave open, as it is at x."""
        if tail:
            objective = objective.completed(x, self.effort.sloped)
        return objective if self.tolerances is None else objective.opened(x, self.tolerances)

    def minimise(
        self, objective: Objective, x: np.ndarray, start: int, stage: str, steps: int
    ) -> Minimum:
        count, tell = max(objective.count, 1), self.progress

        def told(iteration: int, value: float) -> None:
            assert tell is not None
            tell(Progress(start, stage, iteration, 2 * value / count))

        tolerance = LOG_TOLERANCE if objective.logarithmic else self.effort.tolerance
        box = objective.box(x)
        return minimise(objective, x, tolerance, steps, told if tell else None, box=box)
