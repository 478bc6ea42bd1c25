"""What hangs on a link, asked at the links beside it, and of two things on the same one."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.effects.hanging_resonator import HangingResonator
from planner.diagnosis.effects.local_resonator import LocalResonator
from planner.diagnosis.effects.places import links
from planner.diagnosis.effects.two_hanging_resonators import TwoHangingResonators
from planner.diagnosis.linear.fit import Fit, placed
from planner.diagnosis.linear.problem import COARSE, Problem
from planner.diagnosis.linear.three_axis_resonators import FEW, begun, jumped
from planner.fit.held_out import farthest_first
from planner.inference.parallel import side_by_side

PLACES = 2  # links at which a second one is looked for
JUMPS = 5  # of frequencies, at most


def next_door(
    problem: Problem, finalists: Sequence[Fit], effects: Sequence[Effect]
) -> tuple[Fit, ...]:
    """Fits with what hangs in the closest one at the links before and after instead.

    There it looks nearly the same; springs begin where they are known to be by now.
    """
    order = [link for link, _ in links(problem.simulation)]
    known = next(iter(_hanging(finalists).values()), None)
    if known is None:
        return ()
    found, part = known
    there = order.index(part.at)
    sliding = [e for e in effects if isinstance(e, LocalResonator)]
    beside = [e for e in sliding if abs(order.index(e.at) - there) == 1]
    return tuple(
        side_by_side(partial(_anew, problem), [(found, HangingResonator.of(e)) for e in beside])
    )


def second_resonators(problem: Problem, finalists: Sequence[Fit]) -> tuple[Fit, ...]:
    """Fits with two at one link: at the links at which the closest fits have one.

    Of one fit too, in which another link's may stand for the second one here.
    """
    there = list(_hanging(finalists).values())[:PLACES]
    two = [(found, TwoHangingResonators.of(part)) for found, part in there]
    return tuple(side_by_side(partial(_anew, problem), two))


def _hanging(finalists: Sequence[Fit]) -> dict[str, tuple[Fit, HangingResonator]]:
    """By link what hangs there alone, in the closest fit that has it, the closest of all first."""
    there: dict[str, tuple[Fit, HangingResonator]] = {}
    for found in sorted(finalists, key=lambda f: f.per_value):
        for part in found.effect.parts():
            if isinstance(part, HangingResonator) and not isinstance(part, TwoHangingResonators):
                there.setdefault(part.at, (found, part))
    return there


def _anew(problem: Problem, one: tuple[Fit, HangingResonator]) -> Fit:
    """An effect from a fit's springs, and what it knows of the effect's first one."""
    found, effect = one
    few = problem.at(farthest_first(problem.q)[:FEW].tolist())
    rough = few.misfit(effect, COARSE)
    x, (a, b) = placed(rough, found.named()), rough.split
    x[a:b] = rough.mean[a:b]  # inertias were bent to make up for what is looked for
    starts = effect.starts()
    if isinstance(effect, TwoHangingResonators):
        half = len(effect.first.quantities)
        starts[:, :half] = x[b : b + half]
    # What one alone told was perhaps of both.
    ways = [q.name for q in effect.quantities if "frequency" in q.name]
    return jumped(problem, begun(rough, [np.concatenate([x[:b], s]) for s in starts]), ways, JUMPS)
