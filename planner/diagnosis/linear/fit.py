"""Fit of one candidate: all springs, inertial nuisances and its own parameters together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.objective import ByPose, Misfit, MisfitAtPoint, own_names
from planner.diagnosis.linear.problem import CLOSE, COARSE, FINE, GLANCE, Grade, Problem
from planner.identification.effort import QUICK, STAGES, Effort
from planner.identification.identify import identify
from planner.identification.objective import NEARLY
from planner.inference.evidence import laplace
from planner.inference.least_squares import Minimum, minimise
from planner.inference.parallel import side_by_side

ROUGH_STEPS, PROMISE_STEPS, LAST_STEPS = 8, 2, 12
# Of one effect from its prior's median: valleys of inertias are long. Chosen on one generated cell.
AFRESH_STEPS = 24
LOOSE = 1e-3  # of the value, that a step must gain while all candidates are looked at
SETTLED = 1e-6, 60  # the same, and most steps, of those that are still in question
# The way home from afar: all bands, and every step that logarithms need.
PATIENT = replace(QUICK, stages=STAGES, log_steps=40)
KEPT = 2  # starts that are followed


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

    @cached_property
    def value(self) -> float:
        """−ln of the posterior density at x, but for a constant; ∞ where x cannot be."""
        return self.misfit.value(self.x, self.data) if self.misfit.possible(self.x) else np.inf

    def named(self) -> dict[str, float]:
        """x by name: springs, nuisances, then the effect's own."""
        return dict(zip(self.misfit.names, self.x, strict=True))

    def precision(self, temper: float) -> np.ndarray:
        """(D, D) inverse covariance of x where χ² counts 1/temper."""
        return self.data.normal.sum(axis=0) / temper + np.diag(1 / self.misfit.sd**2)

    def log_evidence(self, temper: float) -> float:
        """Log evidence by Laplace's method, χ² counting 1/temper."""
        sd = self.misfit.sd
        away = (self.x - self.misfit.mean) / sd
        return laplace(float(self.data.chi2.sum()), away, self.precision(temper), sd, temper)

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

    def parameters(
        self, temper: float, part: Effect | None = None
    ) -> dict[str, tuple[float, float, str]]:
        """Value, sd and unit of what belongs to the effect, or to one of its parts."""
        part = part or self.effect
        sd = np.sqrt(np.diagonal(np.linalg.inv(self.precision(temper))))
        p, names = self.misfit.parametrisation, self.misfit.names
        chosen = part.springs(self.misfit.setting.simulation)
        out = {}
        for i, s in enumerate(p.parameters):
            if s.name in chosen:
                value = float(np.exp(self.x[i]))
                out[s.name] = (value, value * float(sd[i]), s.unit)
        for q, name in zip(part.quantities, own_names(part), strict=True):
            i = names.index(name)
            psi = float(self.x[i])
            out[q.name] = (q.value(psi), q.value_sd(psi, float(sd[i])), q.unit)
        return out


def fit(problem: Problem, effect: Effect, warm: Sequence[Fit] = (), grade: Grade = FINE) -> Fit:
    """From the prior's median by way of logarithms, and from each warm one; on a grade's lines."""
    coarse, close = problem.misfit(effect, COARSE), problem.misfit(effect, CLOSE)
    afar = _at(coarse, _best(coarse, [_approach(problem, effect)]))
    ends = [_best(close, points(close, afar)).x]
    for earlier in warm:
        ends.append(_best(close, points(close, earlier)).x)
    last = problem.misfit(effect, grade)
    return _at(last, _minimise(last, _best(close, ends).x, LOOSE, LAST_STEPS))


def staged(problem: Problem, effect: Effect) -> Fit:
    """Of many springs at once, by an identification in bands that widen; settled on all lines.

    Only for effects without parameters but springs.
    """
    ends = side_by_side(partial(_identified, problem, effect), (QUICK, PATIENT))
    return min(ends, key=lambda f: f.value)


def _identified(problem: Problem, effect: Effect, effort: Effort) -> Fit:
    simulation, priors = problem.built(effect, rough=True)
    found = identify(
        problem.frfs, problem.q, simulation, priors,
        band_hz=problem.band_hz, starts=1, effort=effort,
    )  # fmt: skip
    near = approached(problem.misfit(effect, COARSE), [found.mean], PROMISE_STEPS)
    return settle(problem, near)


def glance(problem: Problem, effect: Effect, warm: Fit, steps: int = ROUGH_STEPS) -> Fit:
    """A rough fit with inertias as they are: from the prior's median, and from an earlier fit."""
    coarse = problem.misfit(effect, COARSE)
    ends = [_best(coarse, points(coarse, warm), steps)]
    if len(effect.parts()) == 1:
        ends.append(_best(coarse, [_approach(problem, effect)]))
    return _at(coarse, min(ends, key=lambda m: m.at.value))


def promise(problem: Problem, effect: Effect, warm: Fit) -> Fit:
    """A few steps with all that is free, from an earlier fit."""
    close = problem.misfit(effect, CLOSE)
    return approached(close, points(close, warm), PROMISE_STEPS)


def afresh(problem: Problem, near: Fit) -> Fit:
    """The better of a fit and, for a single effect of the robot, one from the prior's median.

    From inertias and springs that were bent to fit nothing hardly anything leads to what they
    imitate.
    """
    alone = begins_alone(near.effect)
    far = from_median(problem, near, AFRESH_STEPS) if alone else near
    return min((near, far), key=lambda f: f.value)


def begins_alone(effect: Effect) -> bool:
    """Whether an effect can be fitted from its prior's median: one of the robot, by itself."""
    return len(effect.parts()) == 1 and not effect.artefact


def from_median(problem: Problem, near: Fit, steps: int = ROUGH_STEPS) -> Fit:
    """A fit of the same effect on the same lines, from the prior's median."""
    rough, coarse = _approach(problem, near.effect), problem.misfit(near.effect, COARSE)
    starts = [rough]
    if steps > ROUGH_STEPS:
        starts.append(_best(coarse, starts).x)
    named = (dict(zip(coarse.names, x, strict=True)) for x in starts)
    return approached(near.misfit, [placed(near.misfit, known) for known in named], steps)


def _approach(problem: Problem, effect: Effect) -> np.ndarray:
    rough = problem.misfit(effect, GLANCE)
    b = rough.split[1]
    starts = [np.concatenate([rough.mean[:b], psi]) for psi in effect.starts()]
    return _best(rough, starts).x


def _best(
    misfit: Misfit, starts: Sequence[np.ndarray], steps: int = ROUGH_STEPS
) -> Minimum[MisfitAtPoint]:
    """Where the best of the starts leads."""
    if len(starts) > KEPT:
        held = replace(misfit, inertial=False)
        starts = sorted(starts, key=lambda x: _hope(held, x))[:KEPT]
    if len(starts) == 1:
        return _minimise(misfit, starts[0], LOOSE, steps)
    tried = [_minimise(misfit, x, LOOSE, 2) for x in starts]
    first = min(tried, key=lambda m: m.at.value)
    return _minimise(misfit, first.x, LOOSE, steps, first.at)


def _hope(misfit: Misfit, x: np.ndarray) -> float:
    """The value, less what the best of the effect's own parameters would gain at once."""
    at, own = misfit(x), slice(misfit.split[1], None)
    gains = at.gradient[own] ** 2 / (2 * np.maximum(np.diagonal(at.normal)[own], 1e-300))
    return at.value - float(gains.max(initial=0.0))


def approached(misfit: Misfit, starts: Sequence[np.ndarray], steps: int = ROUGH_STEPS) -> Fit:
    """Where the best of the starts leads in so many steps."""
    return _at(misfit, _best(misfit, starts, steps))


def carried_on(problem: Problem, fit: Fit, effect: Effect, steps: int = SETTLED[1]) -> Fit:
    """An effect fitted to the end from where another fit, perhaps of other data, is."""
    misfit = problem.misfit(effect, FINE)
    return follow(misfit, points(misfit, fit)[0], steps)


def settle(problem: Problem, found: Fit, grade: Grade = FINE, steps: int = SETTLED[1]) -> Fit:
    """The same fit on the lines of a grade, followed until nothing more is to be gained."""
    misfit = problem.misfit(found.effect, grade)
    return follow(misfit, placed(misfit, found.named()), steps)


def placed(misfit: Misfit, known: Mapping[str, float]) -> np.ndarray:
    """x of what is known by name; all else, as bearings after a rough look, as it may be."""
    return np.array([known.get(n, m) for n, m in zip(misfit.names, misfit.mean, strict=True)])


def follow(misfit: Misfit, x: np.ndarray, steps: int = SETTLED[1]) -> Fit:
    """The fit to which x leads, until nothing more is to be gained."""
    return _at(misfit, _minimise(misfit, x, SETTLED[0], steps))


def _minimise(
    misfit: Misfit, x: np.ndarray, tolerance: float, steps: int, at: MisfitAtPoint | None = None
) -> Minimum[MisfitAtPoint]:
    lower, upper = (misfit.mean + NEARLY * (side - misfit.mean) for side in misfit.sides)
    box = np.minimum(lower, x), np.maximum(upper, x)
    return minimise(misfit, x, tolerance, steps, longest=misfit.longest, at=at, box=box)


def _at(misfit: Misfit, found: Minimum[MisfitAtPoint]) -> Fit:
    return Fit(misfit.effect, misfit, found.x, found.at.data or misfit.by_pose(found.x))


def points(misfit: Misfit, earlier: Fit) -> list[np.ndarray]:
    """x of an earlier fit, with what is new at its starts.

    Further springs start once as they may be, and once so stiff that they change little.
    """
    known, b = earlier.named(), misfit.split[1]
    names = misfit.names
    there = np.array([name in known for name in names])
    values = np.array([known.get(name, 0.0) for name in names])
    springs = np.arange(len(names)) < misfit.split[0]
    x = np.where(there, values, misfit.mean)
    bases = [x]
    if np.any(springs & ~there):
        bases.append(x + np.where(springs & ~there, 1.5 * misfit.sd, 0.0))
    starts = [np.where(there[b:], values[b:], psi) for psi in misfit.effect.starts()]
    found = [np.concatenate([base[:b], psi]) for base in bases for psi in starts]
    possible = [point for point in np.unique(found, axis=0) if misfit.possible(point)]
    # Inertias that went with an effect which is not there now may be those of no body.
    return possible or [np.concatenate([misfit.mean[:b], psi]) for psi in starts]
