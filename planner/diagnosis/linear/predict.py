"""What a fit says: FRFs at any pose with uncertainty, and how well it agrees where one measured."""

from dataclasses import dataclass, replace

import numpy as np

from planner.diagnosis.effects.effect import Effect, Setting
from planner.diagnosis.linear.fit import Fit, fit, settle
from planner.diagnosis.linear.objective import Misfit
from planner.diagnosis.linear.problem import Grade, Problem
from planner.dynamics.gradient import laplace
from planner.fit.held_out import set_aside
from planner.measurement.agreement import Similarity, similarity_of
from planner.measurement.measured_frfs import Measured
from planner.recording.points import TOOL, Layout

ALL = Grade(256)
SHORT = 10  # steps from a fit on all poses to one on most of them


def predicted(
    problem: Problem, found: Fit, q: np.ndarray, frequency_hz: np.ndarray, temper: float
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and sd (n, 3, 3, F) of FRFs at q (n, dof) in rad, in m/s²/N: physics, no artefacts."""
    cleaned = _without_artefacts(found)
    root = np.linalg.cholesky(np.linalg.inv(found.precision(temper)))
    kept = _columns(found)
    means, sds = [], []
    for row in np.atleast_2d(q):
        h, slope = misfit_at(problem, cleaned, row[None], frequency_hz).response(found.x[kept])
        moved = np.tensordot(root[kept].T, slope[0], axes=(1, 0))
        means.append(h[0])
        sds.append(np.sqrt(np.sum(np.abs(moved) ** 2, axis=0)))
    return np.array(means), np.array(sds)


def _without_artefacts(found: Fit) -> Effect:
    from planner.diagnosis.effects.combined import Both

    parts = [p for p in found.effect.parts() if not p.artefact and p.at]
    return Both.of(*parts) if len(parts) > 1 else (parts[0] if parts else Effect(""))


def _columns(found: Fit) -> np.ndarray:
    """Entries of x that are not an artefact's."""
    b = found.misfit.split[1]
    own = [not p.artefact for p in found.effect.parts() for _ in p.quantities]
    return np.flatnonzero(np.concatenate([np.ones(b, dtype=bool), np.array(own, dtype=bool)]))


def misfit_at(
    problem: Problem,
    effect: Effect,
    q: np.ndarray,
    frequency_hz: np.ndarray,
    rate_1_s: float = 0.0,
    layout: Layout = TOOL,
) -> Misfit:
    """Misfit to nothing measured at q (n, dof) in rad and frequency_hz (F,): for its response.

    Between the points of `layout`. FRFs of records with an exponential window have its rate.
    """
    simulation, p = problem.parametrised(effect)
    lines = np.tile(frequency_hz, (len(q), 1))
    shape = (len(q), *layout.shape, len(frequency_hz))
    s = laplace(lines, rate_1_s)
    unknown, end = np.full(shape, np.inf), np.zeros(len(q))
    nothing = Measured(lines, s, np.ones(shape, complex), unknown, end, layout)
    jacobians = simulation.elastic.body_jacobians(q)
    setting = Setting(simulation, q, s, jacobians, layout)
    matrices = simulation.elastic.with_slopes(q, layout)
    return Misfit(nothing, setting, matrices, p.inertias(jacobians), p, effect)


def similarity(problem: Problem, found: Fit | None) -> Similarity:
    """Of a fit (None: the simulation as it stands) to the FRFs of a problem, artefacts included."""
    if found is None:
        problem = replace(problem, as_built=False)
    misfit = problem.misfit(Effect("") if found is None else found.effect, ALL)
    h = misfit.response(misfit.mean if found is None else found.x)[0]
    return similarity_of(misfit.measured, h)


@dataclass(frozen=True)
class ThreefoldSimilarity:
    """Nominal, refitted and explained simulation beside what was measured."""

    nominal: Similarity
    refitted: Similarity
    explained: Similarity


def agreement(problem: Problem, refitted: Fit, best: Fit) -> ThreefoldSimilarity:
    """On the poses of the problem."""
    found = (similarity(problem, f) for f in (None, refitted, best))
    return ThreefoldSimilarity(*found)


def held_out(
    problem: Problem, refitted: Fit, best: Fit
) -> tuple[tuple[int, ...], ThreefoldSimilarity | None]:
    """Poses set aside, and agreement there of fits that never saw them.

    Which effect it is was decided with all poses; its values are fitted without these.
    """
    aside = set_aside(problem.q)
    if not aside:
        return (), None
    rest = problem.at([i for i in range(len(problem.q)) if i not in aside])
    again = [anew(rest, refitted)]
    again.append(again[0] if best is refitted else anew(rest, best))
    return aside, agreement(problem.at(aside), *again)


def anew(rest: Problem, found: Fit) -> Fit:
    """The fit without some poses: the better of one from afar and one from the fit on all."""
    near = settle(rest, found, steps=SHORT)
    if found.effect.at:
        return near
    far = settle(rest, fit(rest, found.effect), steps=SHORT)
    return min((near, far), key=lambda f: f.per_value)
