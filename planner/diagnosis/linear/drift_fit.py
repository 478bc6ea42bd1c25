"""Visits of poses, each for itself, as data of the fit: with drift each has springs of its own."""

from dataclasses import dataclass, field, replace

import numpy as np

from planner.dataset.dataset import Dataset
from planner.diagnosis.effects.drift import Drift
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.linear.objective import Misfit
from planner.diagnosis.linear.problem import Grade, Problem
from planner.dynamics.gradient import Inertias, motion_slopes, moved
from planner.dynamics.motion import ActualPorts, Turned
from planner.dynamics.simulation import Simulation
from planner.measurement.measured_frfs import common_band


@dataclass(frozen=True, eq=False)
class DriftMisfit(Misfit):
    """As `Misfit`, each visit with springs of its own: those of x times e^ψ."""

    order: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def values(self, x: np.ndarray, actual: ActualPorts | None = None) -> tuple[np.ndarray, Turned]:
        h, _, turned = self.parts(x, actual)
        return h, turned

    def parts(
        self, x: np.ndarray, actual: ActualPorts | None = None
    ) -> tuple[np.ndarray, np.ndarray, Turned]:
        assert isinstance(self.effect, Drift)
        p, (a, b) = self.parametrisation, self.split
        elasticity = p.elasticity(x[:a])
        psi, slope = self.effect.log_factor(self.order, x[b:])
        members = self.effect.members(self.setting.simulation)
        mass = self.matrices.mass + self.inertias.mass_change(x[a:b])
        values, slopes, turns = [], [], []
        for i in range(len(self.order)):
            now = replace(elasticity, stiffness=elasticity.stiffness * np.exp(members @ psi[i]))
            one = slice(i, i + 1)
            m = self.matrices
            matrices = m.at(one)
            inertias = None
            if self.inertial:
                inertias = Inertias(self.inertias.jacobians[one], self.inertias.basis)
            ports = None if actual is None else actual.at(one)
            motion = moved(matrices, now, self.setting.s[one], mass[one], actual=ports)
            full = motion_slopes(motion, now, inertias)
            e, springs = p.size, len(p.held)
            theta = np.einsum("np...,pq->nq...", full[:, :springs], p.spread, optimize=True)
            along = np.einsum("ne...,eg->ng...", full[:, :e], members)
            own = np.einsum("pg,ng...->np...", slope[i], along)
            values.append(motion.accelerance)
            turns.append(motion)
            slopes.append(np.concatenate([theta, full[:, springs:], own], axis=1))
        return np.concatenate(values), np.concatenate(slopes), Turned(tuple(turns))


@dataclass(frozen=True, eq=False)
class DriftProblem(Problem):
    """A problem whose FRFs are those of visits at `order` (n,)."""

    order: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def misfit(self, effect: Effect, grade: Grade) -> Misfit:
        """See `Problem.misfit`."""
        plain = super().misfit(effect, grade)
        if not isinstance(effect, Drift):
            return plain
        fields = {name: getattr(plain, name) for name in plain.__dataclass_fields__}
        return DriftMisfit(**fields, order=self.order)


@dataclass(frozen=True, eq=False)
class DriftFits:
    """The simulation refitted to visits, without drift and with it."""

    problem: DriftProblem
    refitted: Fit
    best: Fit


def problem_of(recorded: Dataset, nominal: Simulation, *, as_built: bool = False) -> DriftProblem:
    """Visits (n), each for itself, as data of `fit`: FRFs in m/s²/N, poses in rad.

    Raises InputError where nothing of them lies in robot.toml's band.
    """
    band = common_band(recorded.visit_frfs, recorded.band_hz)
    order = np.array([visit.order for visit in recorded.visits])
    visits = recorded.visit_frfs, recorded.visit_q
    return DriftProblem(*visits, nominal, band, as_built=as_built, order=order)
