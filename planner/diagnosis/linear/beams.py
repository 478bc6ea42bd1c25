"""Links that were seen to bend at one place, asked whether they bend as beams."""

from collections.abc import Sequence
from functools import partial

from planner.diagnosis.effects.combined import Both
from planner.diagnosis.effects.link_flexibility import LinkFlexibility
from planner.diagnosis.linear.evidence import best_of
from planner.diagnosis.linear.fit import Fit, afresh, approached, points
from planner.diagnosis.linear.problem import CLOSE, Problem
from planner.inference.parallel import side_by_side

MOST = 2  # fits of which that is asked


def as_beams(problem: Problem, finalists: Sequence[Fit]) -> tuple[Fit, ...]:
    """Rough fits in which the links of the best fits that have bending ones are beams."""
    there: dict[frozenset[tuple[str, str]], Fit] = {}
    for f in best_of([f for f in finalists if any(map(_bends, f.effect.parts()))], len(finalists)):
        there.setdefault(frozenset((p.name, p.at) for p in f.effect.parts()), f)
    return tuple(side_by_side(partial(_as_beam, problem), list(there.values())[:MOST]))


def _bends(effect: object) -> bool:
    return isinstance(effect, LinkFlexibility) and effect.bends_at_one_place()


def _as_beam(problem: Problem, found: Fit) -> Fit:
    parts = [p.as_beam() if _bends(p) else p for p in found.effect.parts()]
    effect = parts[0] if len(parts) == 1 else Both.of(*parts)
    misfit = problem.misfit(effect, CLOSE)
    near = approached(misfit, points(misfit, found))
    return afresh(problem, near)
