"""The search for what explains FRFs: all candidates roughly, few of them closely."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from planner.diagnose.both import together
from planner.diagnose.effect import Effect
from planner.diagnose.fit import CLOSE, Fit, Problem, fit, settle
from planner.diagnose.weigh import temper_of

REACH = 40.0  # tempered log evidence behind the best, within which a candidate is followed
FIRST, LAST = 12, 6  # candidates followed, and settled on all lines
STEPS = 25
ENOUGH = 1.15  # misfit at which nothing is left for a second effect to explain
LEADERS = 2  # whose company is looked for
Tell = Callable[[str, float], None]  # what is done, and the share of all that is done


@dataclass(frozen=True, eq=False)
class Found:
    """All fits on the finest lines, "none" first, and how far behind the others were left."""

    finalists: tuple[Fit, ...]
    left: tuple[tuple[Effect, float, Fit], ...]  # log evidence behind the best when it was left


def search(problem: Problem, refitted: Fit, effects: Sequence[Effect], tell: Tell) -> Found:
    """Fit all effects beside `refitted`, the fit of none, and pairs where one is not enough."""
    found = _round(problem, [refitted], effects, lambda text, share: tell(text, 0.6 * share))
    best = min(f.per_value for f in found.finalists)
    if best <= ENOUGH:
        return found
    ranked = _ranked(found.finalists)
    leaders = [f for f in ranked if f.effect.at][:LEADERS]
    for number, leader in enumerate(leaders):
        pairs = [p for e in effects if (p := together(leader.effect, e)) is not None]

        def along(text: str, share: float, number: int = number) -> None:
            tell(text, 0.6 + 0.4 * (number + share) / len(leaders))

        more = _round(problem, [leader], pairs, along)
        kept = tuple(f for f in more.finalists if len(f.effect.parts()) > 1)
        found = Found((*found.finalists, *kept), (*found.left, *more.left))
    return found


def _round(problem: Problem, warm: Sequence[Fit], effects: Sequence[Effect], tell: Tell) -> Found:
    fits = [settle(problem, w, CLOSE, STEPS) for w in warm]
    for number, effect in enumerate(effects):
        tell(_words(effect), 0.8 * number / max(len(effects), 1))
        fits.append(fit(problem, effect, warm))
    fits, left = _cut(fits, FIRST)
    tell("following the best", 0.8)
    fits, more = _cut([settle(problem, f, CLOSE, STEPS) for f in fits], LAST)
    tell("settling", 0.9)
    return Found(tuple(settle(problem, f) for f in fits), (*left, *more))


def _words(effect: Effect) -> str:
    return " and ".join(f"{p.name.replace('_', ' ')} at {p.at}" for p in effect.parts())


def _ranked(fits: Sequence[Fit]) -> list[Fit]:
    t = temper_of(fits)
    return sorted(fits, key=lambda f: -f.log_evidence(t))


def _cut(fits: Sequence[Fit], most: int) -> tuple[list[Fit], tuple[tuple[Effect, float, Fit], ...]]:
    """The first, and the best others; those that are left, by how far they are behind."""
    t = temper_of(fits)
    evidence = np.array([f.log_evidence(t) for f in fits])
    behind = evidence.max() - evidence
    order = [0, *(i for i in np.argsort(behind) if i)]
    kept = {i for place, i in enumerate(order) if i == 0 or (place < most and behind[i] < REACH)}
    left = tuple((fits[i].effect, float(behind[i]), fits[i]) for i in order if i not in kept)
    return [fits[i] for i in order if i in kept], left
