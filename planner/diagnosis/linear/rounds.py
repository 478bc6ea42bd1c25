"""One round of the search: all candidates roughly, few of them closely, the best to the end."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.evidence import cut, lag
from planner.diagnosis.linear.fit import (
    AFRESH_STEPS,
    ROUGH_STEPS,
    Fit,
    afresh,
    approached,
    begins_alone,
    from_median,
    glance,
    promise,
    settle,
)
from planner.diagnosis.linear.found import Found
from planner.diagnosis.linear.other_places import inertias_bent
from planner.diagnosis.linear.problem import CLOSE, FINE, Grade, Problem
from planner.diagnosis.thresholds import CLEARLY_WRONG
from planner.fit.held_out import farthest_first
from planner.inference.parallel import side_by_side
from planner.progress import Tell

FIRST, LAST = 10, 4  # candidates followed, and settled on all lines
STEPS, LAST_STEPS = 12, 30
BEGUN = 3  # steps of each pair, before the most promising are followed
FEW = 5  # poses on which all are looked at where something is clearly wrong
FAR = 6  # effects begun at their priors' medians that are followed, where inertias are bent
CARRIED = 5  # effects begun where another fit ended, that are followed
HOPELESS = 1.0  # tempered log evidence that the best of all would have to gain to be followed


def one_round(problem: Problem, warm: Fit, effects: Sequence[Effect], tell: Tell) -> Found:
    """Candidates beside what `warm` has: roughly all, closely few, to the end the best."""
    none, effects = settle(problem, warm, CLOSE, STEPS), list(filter(problem.able, effects))
    clearly = none.per_value > CLEARLY_WRONG
    few = _few(problem) if clearly else problem
    look = glance if clearly else promise
    pairs = clearly and min((len(e.parts()) for e in effects), default=0) > 1
    looked = (
        partial(glance, few, warm=none, steps=BEGUN) if pairs else partial(look, few, warm=none)
    )
    share = 0.6 / max(len(effects), 1)
    fits = side_by_side(looked, effects, lambda n, count: tell(_words(effects[n]), share * count))
    if pairs:
        fits = _gone_on(fits)
    if not clearly and inertias_bent(none):
        fits = _unbent(problem, fits)
    if clearly:
        order = np.argsort([f.value for f in fits])
        close = settled(problem, [fits[i] for i in order[:FIRST]], CLOSE, STEPS)
        close = side_by_side(partial(afresh, problem), close)
        if pairs:
            close = _best_of_each([*close, *carried_from(problem, none, effects)])
        worst = max(lag([none, *close]))
        followed = {frozenset(f.effect.parts()) for f in close}
        rest = [fits[i] for i in order[FIRST:]]
        left = [(f.effect, worst, f) for f in rest if frozenset(f.effect.parts()) not in followed]
    else:
        kept, left = cut([none, *fits], FIRST)
        if min(lag([none, *fits])[1:]) - lag([none, *fits])[0] > -HOPELESS:
            kept, more = cut([none, *fits], 1)
            return Found((settle(problem, none),), tuple(more))
        close = settled(problem, kept[1:], CLOSE, STEPS)
    tell("following the best", 0.8)
    kept, more = cut([none, *close], LAST)
    tell("settling", 0.9)
    return Found(tuple(settled(problem, kept)), (*left, *more))


def carried_from(problem: Problem, ended: Fit, effects: Sequence[Effect]) -> list[Fit]:
    """Effects begun where another fit ended, the most promising followed."""
    able, few = list(filter(problem.able, effects)), _few(problem)
    begun = side_by_side(partial(promise, few, warm=ended), able)
    order = np.argsort([f.value for f in begun])
    return settled(problem, [begun[i] for i in order[:CARRIED]], CLOSE, STEPS)


def _best_of_each(fits: Sequence[Fit]) -> list[Fit]:
    """Each set of effects once, at its best."""
    best: dict[frozenset[Effect], Fit] = {}
    for f in sorted(fits, key=lambda f: f.value):
        best.setdefault(frozenset(f.effect.parts()), f)
    return list(best.values())


def _few(problem: Problem) -> Problem:
    return problem.at(farthest_first(problem.q)[:FEW].tolist())


def _unbent(problem: Problem, near: Sequence[Fit]) -> list[Fit]:
    """Fits, or those from their priors' medians that lead farther.

    What begins there is far behind inertias that were bent to fit, for many steps: the best of
    these are told apart among themselves, and followed.
    """
    alone = [i for i, f in enumerate(near) if begins_alone(f.effect)]
    far = dict(
        zip(
            alone,
            side_by_side(partial(from_median, problem), [near[i] for i in alone]),
            strict=True,
        )
    )
    best = sorted(alone, key=lambda i: far[i].value)[:FAR]
    more = side_by_side(_carried_far, [far[i] for i in best])
    far |= dict(zip(best, more, strict=True))
    return [min((f, far.get(i, f)), key=lambda f: f.value) for i, f in enumerate(near)]


def _carried_far(begun: Fit) -> Fit:
    return approached(begun.misfit, [begun.x], AFRESH_STEPS - ROUGH_STEPS)


def _gone_on(begun: Sequence[Fit]) -> list[Fit]:
    """Rough fits, the most promising of them followed as far as `glance` goes."""
    order = np.argsort([f.value for f in begun])
    best = [begun[i] for i in order[: 2 * FIRST]]
    return side_by_side(_rough, best) + [begun[i] for i in order[2 * FIRST :]]


def _rough(begun: Fit) -> Fit:
    return approached(begun.misfit, [begun.x], ROUGH_STEPS - BEGUN)


def _words(effect: Effect) -> str:
    return " and ".join(f"{p.name.replace('_', ' ')} at {p.at}" for p in effect.parts())


def settled(
    problem: Problem, fits: Sequence[Fit], grade: Grade = FINE, steps: int = LAST_STEPS
) -> list[Fit]:
    """Fits on the lines of a grade, all at once."""
    return side_by_side(partial(settle, problem, grade=grade, steps=steps), fits)
