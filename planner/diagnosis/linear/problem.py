"""What all candidates of a diagnosis share: the FRFs, the simulation, and how closely one looks."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from planner.diagnosis.effects.effect import Effect, Setting
from planner.diagnosis.effects.structural_damping import partly_structural
from planner.diagnosis.linear.objective import Misfit
from planner.diagnosis.thresholds import (
    DAMPING_FACTOR,
    ERRORS_SPREAD,
    LOSS_FACTOR_FACTOR,
    MASS_ELSEWHERE,
    STIFFNESS_FACTOR,
)
from planner.dynamics.gradient import Inertias
from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.frf.frf import Frf
from planner.identification.measured_frfs import Measured, layout_of, matrices_at, stack
from planner.identification.measurement_model import Tolerances
from planner.identification.parameters import CAD_INERTIAS, Parametrisation, Priors, parametrise
from planner.recording.points import Layout
from planner.robot.elastic_model import Matrices

PRIORS = replace(
    CAD_INERTIAS, stiffness_factor=STIFFNESS_FACTOR, damping_factor=DAMPING_FACTOR,
    loss_factor_factor=LOSS_FACTOR_FACTOR, elsewhere=MASS_ELSEWHERE,
)  # fmt: skip


@dataclass(frozen=True)
class Grade:
    """How closely one looks: lines a pose, relative sd of all that no simulation follows.

    None: of what does not matter, robot.toml's. Every robot has bearings that give a little and
    gears that ripple: weighed by the noise, inertias would be bent by any number of their sds to
    follow them. As in `Misfit`: whether logarithms are compared, and whether inertias are free.
    """

    lines: int
    model_error: float | None = None
    logarithmic: bool = False
    inertial: bool = True


GLANCE, COARSE = Grade(32, 0.05, True, False), Grade(32, 0.05, False, False)
CLOSE, FINE = Grade(40), Grade(72)
# More sensors tell more at fewer lines: of these, a power of the number of 3 × 3 FRFs is looked at.
# Chosen so that four sensors take about twice the time of one; resonances need the least number.
SHARED_WORK, LEAST_LINES = -0.35, 28


def tolerances_of(simulation: Simulation) -> Tolerances:
    """What the simulation's robot.toml says of hits, sensor and readback."""
    robot = simulation.robot
    return Tolerances.of(robot.config, robot.joints.slides)


@dataclass(frozen=True, eq=False)
class Problem:
    """What all candidates share: FRFs of n poses at q (n, dof) in rad, and the simulation.

    Where it is `exact`, hits are taken to be on their axes and the measuring chain to be perfect.
    With `lossy` a part of each damper may be a loss factor: every candidate has it, so that none is
    told by how damping goes with frequency.
    """

    frfs: tuple[Frf, ...]
    q: np.ndarray
    simulation: Simulation
    band_hz: tuple[float, float]
    priors: Priors = PRIORS
    exact: bool = False
    lossy: bool = False

    @property
    def layout(self) -> Layout:
        """The points between which FRFs were measured."""
        return layout_of(self.frfs)

    @property
    def blocks(self) -> int:
        """How many FRF matrices of 3 × 3 there are: from each hit point to each sensor."""
        rows, columns = self.layout.shape
        return rows * columns // 9

    @property
    def error(self) -> tuple[float, float]:
        """Relative sd of what does not matter, and the share of it in every direction."""
        return self.simulation.robot.config.diagnose.matters, ERRORS_SPREAD

    def misfit(self, effect: Effect, grade: Grade) -> Misfit:
        """Misfit with an effect."""
        body, measured = _prepared(self, effect), _measured(self, grade)
        setting = Setting(body.simulation, self.q, measured.s, body.jacobians, self.layout)
        inertias, p = body.inertias, body.parametrisation
        tolerances = None if self.exact else tolerances_of(self.simulation)
        kind = grade.logarithmic, grade.inertial, tolerances
        return Misfit(measured, setting, body.matrices, inertias, p, effect, *kind)

    def parametrised(self, effect: Effect) -> tuple[Simulation, Parametrisation]:
        """The simulation with an effect's structure, and its parameters."""
        body = _prepared(self, effect)
        return body.simulation, body.parametrisation

    def able(self, effect: Effect) -> bool:
        """Whether a robot can have it: each spring moves an inertia of its own, beside others."""
        try:
            _prepared(self, effect)
        except InputError:
            return False
        return True

    def at(self, poses: Sequence[int]) -> "Problem":
        """The same with some of the poses only."""
        kept = list(poses)
        return replace(self, frfs=tuple(self.frfs[i] for i in kept), q=self.q[kept])


@dataclass(frozen=True, eq=False)
class _Prepared:
    """What does not depend on the lines."""

    simulation: Simulation
    parametrisation: Parametrisation
    matrices: Matrices
    jacobians: np.ndarray
    inertias: Inertias


@lru_cache(maxsize=512)
def _prepared(problem: Problem, effect: Effect) -> _Prepared:
    simulation = effect.structure(problem.simulation)
    if problem.lossy:
        simulation = partly_structural(simulation)
    p = parametrise(simulation, effect.priors(simulation, problem.priors))
    jacobians = simulation.elastic.body_jacobians(problem.q)
    matrices = matrices_at(simulation.elastic, problem.q, problem.frfs, sloped=True)
    return _Prepared(simulation, p, matrices, jacobians, p.inertias(jacobians))


@lru_cache(maxsize=16)
def _measured(problem: Problem, grade: Grade) -> Measured:
    lines = max(round(grade.lines * problem.blocks**SHARED_WORK), min(grade.lines, LEAST_LINES))
    error, spread = problem.error if grade.model_error is None else (grade.model_error, 0.0)
    return stack(problem.frfs, problem.band_hz, lines, error, spread)
