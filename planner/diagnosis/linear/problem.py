"""What all candidates of a diagnosis share: the FRFs, the simulation, and how closely one looks."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from planner.diagnosis.effects.effect import Effect, Setting
from planner.diagnosis.effects.slight_bearings import with_bearings
from planner.diagnosis.effects.structural_damping import partly_structural
from planner.diagnosis.linear.objective import Misfit
from planner.diagnosis.thresholds import (
    CLOSELY,
    DAMPING_FACTOR,
    ERRORS_SPREAD,
    LOSS_FACTOR_FACTOR,
    MASS_ELSEWHERE,
    STIFFNESS_FACTOR,
)
from planner.dynamics.gradient import Inertias
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import CAD_INERTIAS, Parametrisation, Priors, parametrise
from planner.errors import InputError
from planner.frf.frf import Frf
from planner.measurement.measured_frfs import Measured, layout_of, matrices_at, stack
from planner.measurement.nuisances import Tolerances
from planner.recording.points import Layout
from planner.robot.elastic_model import Matrices

PRIORS = replace(
    CAD_INERTIAS, stiffness_factor=STIFFNESS_FACTOR, damping_factor=DAMPING_FACTOR,
    loss_factor_factor=LOSS_FACTOR_FACTOR, elsewhere=MASS_ELSEWHERE,
)  # fmt: skip


@dataclass(frozen=True)
class Grade:
    """How closely one looks: lines a pose, relative sd of all that no simulation follows.

    None: CLOSELY, and `finely` what does not matter, robot.toml's. Far from the solution one looks
    roughly: fine detail would bend inertias where only a spring is wrong. As in `Misfit`: whether
    logarithms are compared, and whether inertias are free.
    """

    lines: int
    model_error: float | None = None
    logarithmic: bool = False
    inertial: bool = True
    finely: bool = False

    @property
    def rough(self) -> bool:
        """Whether one looks from afar."""
        return self.model_error is not None


GLANCE, COARSE = Grade(32, 0.05, True, False), Grade(32, 0.05, False, False)
CLOSE, FINE = Grade(40), Grade(72, finely=True)
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
    `as_built` every candidate has what each robot has and no robot.toml states: of each damper a
    part may be a loss factor, so that none is told by how damping goes with frequency, and bearings
    give a little across their axes.
    """

    frfs: tuple[Frf, ...]
    q: np.ndarray
    simulation: Simulation
    band_hz: tuple[float, float]
    priors: Priors = PRIORS
    exact: bool = False
    as_built: bool = False

    @property
    def layout(self) -> Layout:
        """The points between which FRFs were measured."""
        return layout_of(self.frfs)

    @property
    def blocks(self) -> int:
        """How many FRF matrices of 3 × 3 there are: from each hit point to each sensor."""
        rows, columns = self.layout.shape
        return rows * columns // 9

    def error(self, grade: Grade) -> tuple[float, float]:
        """Relative sd of what is not followed, and the share of it in every direction."""
        if grade.model_error is not None:
            return grade.model_error, 0.0
        matters = self.simulation.robot.config.diagnose.matters
        return matters if grade.finely and self.as_built else CLOSELY, ERRORS_SPREAD

    def misfit(self, effect: Effect, grade: Grade) -> Misfit:
        """Misfit with an effect."""
        body, measured = _prepared(self, effect, grade.rough), _measured(self, grade)
        setting = Setting(body.simulation, self.q, measured.s, body.jacobians, self.layout)
        inertias, p = body.inertias, body.parametrisation
        tolerances = None if self.exact else tolerances_of(self.simulation)
        kind = grade.logarithmic, grade.inertial, tolerances
        return Misfit(measured, setting, body.matrices, inertias, p, effect, *kind)

    def parametrised(self, effect: Effect) -> tuple[Simulation, Parametrisation]:
        """The simulation with an effect's structure, and its parameters."""
        body = _prepared(self, effect, rough=False)
        return body.simulation, body.parametrisation

    def built(self, effect: Effect, rough: bool = False) -> tuple[Simulation, Priors]:
        """The simulation with an effect's structure, and priors of all its parameters.

        Where one looks `rough`ly, bearings do not give: they would be taken for what is not there.
        """
        simulation = effect.structure(self.simulation)
        if not self.as_built:
            return simulation, effect.priors(simulation, self.priors)
        simulation = partly_structural(simulation)
        priors = effect.priors(simulation, self.priors)
        return (simulation, priors) if rough else with_bearings(simulation, priors)

    def able(self, effect: Effect) -> bool:
        """Whether a robot can have it: each spring moves an inertia of its own, beside others."""
        try:
            _prepared(self, effect, rough=True)
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
def _prepared(problem: Problem, effect: Effect, rough: bool) -> _Prepared:
    simulation, priors = problem.built(effect, rough)
    p = parametrise(simulation, priors)
    jacobians = simulation.elastic.body_jacobians(problem.q)
    matrices = matrices_at(simulation.elastic, problem.q, problem.frfs, sloped=True)
    return _Prepared(simulation, p, matrices, jacobians, p.inertias(jacobians))


@lru_cache(maxsize=16)
def _measured(problem: Problem, grade: Grade) -> Measured:
    lines = max(round(grade.lines * problem.blocks**SHARED_WORK), min(grade.lines, LEAST_LINES))
    return stack(problem.frfs, problem.band_hz, lines, *problem.error(grade))
