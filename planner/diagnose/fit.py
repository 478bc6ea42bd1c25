"""Fit of one candidate: all springs, inertial nuisances and its own parameters together."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.diagnose.effect import Effect, Setting
from planner.diagnose.objective import ByPose, Misfit
from planner.frf.types import Frf
from planner.identify.check import MODEL_ERROR
from planner.identify.data import stack
from planner.identify.parameters import UNITS, Priors, parametrise
from planner.identify.solver import minimise
from planner.physics.simulation import Simulation

# Stated stiffness and damping scatter by this factor (1 sd) without anything being wrong.
PRIORS = Priors(stiffness_factor=1.2, damping_factor=1.6, mass=0.05, inertia=0.05, com_m=0.01)
LOG_LINES, LINES = 32, 96  # a pose
LOG_STEPS, STEPS = 10, 12
TOLERANCE = 1e-3  # of the value, that a step must gain while all candidates are looked at
SETTLED = 1e-6, 80  # the same, and most steps, of those that are still in question
KEPT = 2  # starts that are followed to the end


@dataclass(frozen=True, eq=False)
class Problem:
    """What all candidates share: FRFs of n poses at q (n, dof) in rad, and the simulation."""

    frfs: tuple[Frf, ...]
    q: np.ndarray
    simulation: Simulation
    band_hz: tuple[float, float]
    priors: Priors = PRIORS

    def misfit(self, effect: Effect, lines: int, logarithmic: bool = False) -> Misfit:
        """Misfit with an effect, on at most `lines` lines a pose."""
        simulation = effect.structure(self.simulation)
        p = parametrise(simulation, effect.priors(simulation, self.priors))
        measured = stack(self.frfs, self.band_hz, lines, MODEL_ERROR)
        jacobians = simulation.elastic.body_jacobians(self.q)
        setting = Setting(simulation, self.q, measured.s, jacobians)
        matrices = simulation.elastic.matrices(self.q)
        return Misfit(measured, setting, matrices, p.inertias(jacobians), p, effect, logarithmic)


@dataclass(frozen=True, eq=False)
class Fit:
    """One candidate at its best x."""

    effect: Effect
    misfit: Misfit
    x: np.ndarray
    data: ByPose

    @property
    def per_value(self) -> float:
        """χ² per real value, 1 at the noise."""
        return float(self.data.chi2.sum() / max(self.misfit.counts.sum(), 1))

    def named(self) -> dict[str, float]:
        """x by name: springs, nuisances, then the effect's own."""
        p = self.misfit.parametrisation
        names = [*(s.name for s in p.parameters), *p.nuisances]
        return dict(zip(names, self.x, strict=False))

    def precision(self, temper: float) -> np.ndarray:
        """(D, D) inverse covariance of x where χ² counts 1/temper."""
        return self.data.normal.sum(axis=0) / temper + np.diag(1 / self.misfit.sd**2)

    def log_evidence(self, temper: float) -> float:
        """Laplace: −χ²/2T − prior/2 − ½ ln |posterior precision · prior covariance|."""
        sd = self.misfit.sd
        away = (self.x - self.misfit.mean) / sd
        volume = np.linalg.slogdet(self.precision(temper) * np.outer(sd, sd))[1]
        chi2 = float(self.data.chi2.sum())
        return -chi2 / (2 * temper) - float(away @ away) / 2 - volume / 2

    def held_out(self, temper: float) -> np.ndarray:
        """(n,) χ² of each pose when it is left out: one Newton step on what the others tell."""
        total = self.precision(temper)
        prior = (self.x - self.misfit.mean) / self.misfit.sd**2
        gradient = self.data.gradient.sum(axis=0) / temper + prior
        out = np.empty(len(self.data.chi2))
        for i, (chi2, g, n) in enumerate(
            zip(self.data.chi2, self.data.gradient, self.data.normal, strict=True)
        ):
            step = -np.linalg.solve(total - n / temper, gradient - g / temper)
            out[i] = chi2 + 2 * g @ step + step @ n @ step
        return out

    def parameters(self, temper: float) -> dict[str, tuple[float, float, str]]:
        """Value, sd and unit of what belongs to the effect."""
        sd = np.sqrt(np.diagonal(np.linalg.inv(self.precision(temper))))
        p, b = self.misfit.parametrisation, self.misfit.split[1]
        chosen = self.effect.springs(self.misfit.setting.simulation)
        out = {}
        for i, s in enumerate(p.parameters):
            if s.name in chosen:
                value = float(np.exp(self.x[i]))
                out[s.name] = (value, value * float(sd[i]), UNITS[s.kind])
        for i, q in enumerate(self.effect.quantities, b):
            psi = float(self.x[i])
            out[q.name] = (q.value(psi), q.value_sd(psi, float(sd[i])), q.unit)
        return out


def fit(problem: Problem, effect: Effect, warm: Sequence[Fit] = ()) -> Fit:
    """Fit from the prior's median and from each warm one, each from all of the effect's starts."""
    rough = problem.misfit(effect, LOG_LINES, logarithmic=True)
    objective = problem.misfit(effect, LINES)
    points = [x for base in _bases(rough, warm) for x in _with_starts(rough, base)]
    if len(points) > 1:
        found = [minimise(rough, x, 1e-2, 3) for x in points]
        best = sorted(found, key=lambda m: m.at.value)[:KEPT]
        points = [m.x for m in best]
    ends = [minimise(rough, x, 1e-3, LOG_STEPS) for x in points]
    end = min(ends, key=lambda m: m.at.value)
    last = minimise(objective, end.x, TOLERANCE, STEPS)
    return Fit(effect, objective, last.x, objective.by_pose(last.x))


def settle(found: Fit) -> Fit:
    """The same fit, followed until nothing more is to be gained."""
    last = minimise(found.misfit, found.x, *SETTLED)
    return replace(found, x=last.x, data=found.misfit.by_pose(last.x))


def _bases(misfit: Misfit, warm: Sequence[Fit]) -> list[np.ndarray]:
    if not warm:
        return [misfit.mean]
    p, out = misfit.parametrisation, []
    for earlier in warm:
        known, x = earlier.named(), misfit.mean
        for i, name in enumerate([*(s.name for s in p.parameters), *p.nuisances]):
            x[i] = known.get(name, x[i])
        out.append(x)
    return out


def _with_starts(misfit: Misfit, base: np.ndarray) -> list[np.ndarray]:
    b = misfit.split[1]
    return [np.concatenate([base[:b], psi]) for psi in misfit.effect.starts()]
