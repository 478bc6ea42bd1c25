"""The screen for one law at several joints at once, as of drives that all harden.

Laws are fitted to some of the poses and judged at the others.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from planner.dataset.dataset import Dataset
from planner.diagnosis.finding import Finding
from planner.diagnosis.laws.equivalent_stiffness import own_springs
from planner.diagnosis.laws.fit_in_time import LawProblem
from planner.diagnosis.laws.law_at_joints import LawAtJoints, LawMisfit
from planner.diagnosis.laws.level_refits import Refit, base, refits
from planner.diagnosis.laws.open_misses import OpenMisses
from planner.diagnosis.laws.several_joints import (
    beginning,
    differences,
    problem_of_levels,
    settled,
    straightened,
)
from planner.diagnosis.laws.torque_laws import LAWS, Law, behaviour
from planner.diagnosis.linear.problem import tolerances_of
from planner.diagnosis.thresholds import (
    INDEPENDENT,
    SEVERAL_CHANGES,
    SEVERAL_EVIDENCE,
    SEVERAL_EXPLAINS,
    SEVERAL_HOPEFUL,
    SEVERAL_INEXACT,
    SEVERAL_MATTERS,
    SEVERAL_RIVAL,
)
from planner.dynamics.simulation import Simulation
from planner.inference.evidence import unexplained_shares
from planner.inference.parallel import side_by_side

FITTED, LEAST_VISITS = 4, 3  # poses that laws are fitted to, of how many at least
AFAR, NEAR, CLOSE = (0.3,), (0.1,), (0.03,)  # shares by which errors are softened, in turn


@dataclass(frozen=True, eq=False)
class SharedLaw:
    """A law at all joints, and the share of the levels' differences that it explains elsewhere.

    `changes` (m,): by how much of its stiffness each joint changes from the weakest hits to the
    strongest ones.
    """

    fit: LawMisfit
    changes: np.ndarray
    explained: float
    left: float

    @property
    def bent(self) -> list[int]:
        """Joints that change."""
        return np.flatnonzero(np.abs(self.changes) > SEVERAL_CHANGES).tolist()


def screen(recorded: Dataset, nominal: Simulation) -> tuple[Finding, ...]:
    """One law at two joints or more; nothing where that does not explain the force levels."""
    visits = [v for v in recorded.visits if len({recorded.level(h) for h in v.hits}) > 1]
    if len(visits) < LEAST_VISITS:
        return ()
    count = min(FITTED, len(visits) - 1)
    fitted = set(np.linspace(0, len(visits) - 1, count).round().astype(int).tolist())
    few = recorded.corrected(visits[i] for i in sorted(fitted))
    others = tuple(v for i, v in enumerate(visits) if i not in fitted)
    told = _problem(few, nominal)
    judged = _problem(recorded.corrected(others), nominal)
    found = _laws(told, judged, refits(few, nominal))
    best = found[0]
    named = _that_matter(judged, best) if best.explained > SEVERAL_EXPLAINS else []
    if len(named) < 2:
        return ()
    share = unexplained_shares([f.left for f in found], INDEPENDENT)[0]
    sure = min(best.explained, float(share))
    return _findings(best, own_springs(nominal)[0], named, sure)


def _problem(recorded: Dataset, nominal: Simulation) -> LawProblem:
    plain = base(recorded, nominal)
    misses = OpenMisses.told(plain, recorded, tolerances_of(nominal))
    return problem_of_levels(recorded, plain, misses)


def _laws(told: LawProblem, judged: LawProblem, seen: Sequence[Refit]) -> list[SharedLaw]:
    """Laws fitted to what is told, best first as judged elsewhere."""

    def closer(some: Sequence[SharedLaw], softness: tuple[float, ...]) -> list[SharedLaw]:
        laws = [one.fit.law for one in some]
        new = side_by_side(partial(_settled, told, judged, softness), laws)
        return [min(both, key=lambda one: one.left) for both in zip(some, new, strict=True)]

    begun = [beginning(seen, *kind, told.plain) for kind in _kinds(seen)]
    afar = _ordered(side_by_side(partial(_settled, told, judged, AFAR), begun))
    best = afar[0]
    if best.explained < SEVERAL_HOPEFUL or len(_that_matter(judged, best)) < 2:
        return afar
    rivals = [one for one in afar if one.left < SEVERAL_RIVAL * best.left]
    first, *rest = _ordered([*closer(rivals, NEAR), *afar[len(rivals) :]])
    return _ordered([*closer([first], CLOSE), *rest])


def _ordered(some: Sequence[SharedLaw]) -> list[SharedLaw]:
    return sorted(some, key=lambda one: one.left)


def _settled(
    told: LawProblem, judged: LawProblem, softness: Sequence[float], begun: LawAtJoints
) -> SharedLaw:
    """Fitted to what is told, judged elsewhere."""
    fit = settled(told, begun, softness)
    left, before, count = differences(judged, fit.law)
    to_explain = before - count
    explained = 1 - max(left - count, 0.0) / to_explain if to_explain > 0 else 0.0
    changes = _changes(fit, told.data.level)
    return SharedLaw(fit, changes, explained, max(left - count, INDEPENDENT / 2))


def _that_matter(judged: LawProblem, best: SharedLaw) -> list[int]:
    """Joints that, with a spring in the stead of their law, would explain the levels less."""
    whole, before, count = differences(judged, best.fit.law)
    out = []
    for j in best.bent:
        left, _, _ = differences(judged, straightened(judged.plain, best.fit, j))
        if left - whole > SEVERAL_MATTERS * (before - count):
            out.append(j)
    return out


def _kinds(seen: Sequence[Refit]) -> list[tuple[Law, int]]:
    """Laws, with the sign of k, that go the way in which joints change from level to level."""
    of = {law.effect: law for law in LAWS}
    stiffening = of["nonlinear_stiffness"]
    if np.sum(np.log(seen[-1].stiffness / seen[0].stiffness)) > 0:
        return [(stiffening, 1), (of["backlash"], 1)]
    return [(of["friction"], 1), (stiffening, -1)]


def _changes(fit: LawMisfit, level: np.ndarray) -> np.ndarray:
    if fit.stiffer is None:
        return np.zeros(len(fit.law.scale))
    share = fit.stiffer / fit.law.scale
    strong, weak = (np.median(share[level == one], axis=0) for one in (level.max(), level.min()))
    return strong - weak


def _findings(
    best: SharedLaw, ports: tuple[str, ...], named: list[int], sure: float
) -> tuple[Finding, ...]:
    law = best.fit.law
    m, spread = len(law.scale), best.fit.covariance(1.0)[len(law.x) :, len(law.x) :]
    out = []
    for j in named:
        port = ports[j]
        parameters = law.parameters(j, spread[np.ix_([j, m + j], [j, m + j])], SEVERAL_INEXACT)
        told = ", ".join(
            f"{name.replace('_', ' ')} {v:.3g} ± {sd:.1g} {unit}"
            for name, (v, sd, unit) in parameters.items()
        )
        how = behaviour(law.effect, law.sign)
        text = f"{port.replace('_', ' ').capitalize()} {how} ({told})."
        if not out:
            text += (
                f" With the same in other joints it explains {100 * best.explained:.0f} % of how "
                "FRFs change with the force at poses that were not fitted."
            )
        out.append(Finding(law.effect, port, SEVERAL_EVIDENCE, parameters, text, sure=sure))
    return tuple(out)
