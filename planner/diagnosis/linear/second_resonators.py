"""Something else that hangs on a link beside what is known to hang there."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from planner.diagnosis.effects.hanging_resonator import WAYS, HangingResonator
from planner.diagnosis.effects.two_hanging_resonators import SECOND, TwoHangingResonators
from planner.diagnosis.linear.fit import Fit, points
from planner.diagnosis.linear.problem import COARSE, Problem
from planner.diagnosis.linear.three_axis_resonators import FEW, begun, jumped
from planner.identification.held_out import farthest_first
from planner.inference.parallel import side_by_side

PLACES = 2  # links at which a second one is looked for
JUMPS = 5  # of frequencies, at most


def second_resonators(problem: Problem, finalists: Sequence[Fit]) -> tuple[Fit, ...]:
    """Fits with two at one link: at the links at which the closest fits have one.

    Of one fit too, in which another link's may stand for the second one here.
    """
    there: dict[str, tuple[Fit, HangingResonator]] = {}
    for found in sorted(finalists, key=lambda f: f.per_value):
        for part in found.effect.parts():
            if isinstance(part, HangingResonator) and not isinstance(part, TwoHangingResonators):
                there.setdefault(part.at, (found, part))
    return tuple(side_by_side(partial(_joined, problem), list(there.values())[:PLACES]))


def _joined(problem: Problem, one: tuple[Fit, HangingResonator]) -> Fit:
    found, part = one
    effect = TwoHangingResonators.of(part)
    few = problem.at(farthest_first(problem.q)[:FEW].tolist())
    rough = few.misfit(effect, COARSE)
    known, (a, b) = points(rough, found)[0], rough.split
    known[a:b] = rough.mean[a:b]  # inertias were bent to make up for what is looked for
    own = len(known) - len(part.quantities)
    starts = [np.concatenate([known[:own], psi]) for psi in part.starts()]
    ways = [*WAYS, *(SECOND + name for name in WAYS)]  # what one alone told was perhaps of both
    return jumped(problem, begun(rough, starts), ways, JUMPS)
