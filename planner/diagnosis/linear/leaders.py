"""Which single effects lead a search: what may be beside them is looked for."""

import numpy as np

from planner.diagnosis.effects.combined import Family
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.evidence import lag
from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.linear.found import Found
from planner.diagnosis.thresholds import AT_NOISE

FEW_EFFECTS = 2  # at once
FAR = 4.0  # times the best's χ² per value: what leaves more leads nowhere; chosen
Place = tuple[str, str]


def best_of_few(found: Found) -> Fit:
    """The closest of one or two effects: many at once fit what only one other does as well."""
    few = [
        f
        for f in found.finalists
        if isinstance(f.effect, Family) or len(f.effect.parts()) <= FEW_EFFECTS
    ]
    return min(few, key=lambda f: f.per_value)


def place_of(effect: Effect) -> Place:
    return effect.name, effect.at


def next_leader(leaders: list[Fit], led: list[Place], found: Found) -> Fit | None:
    """The next single effect whose company is looked for.

    Once two explain everything, that of the other too: the first was the best perhaps alone.
    """
    waiting = [f for f in leaders if place_of(f.effect) not in led]
    best = best_of_few(found)
    if best.per_value <= AT_NOISE:
        members = [place_of(e) for e in best.effect.parts()]
        waiting = [f for f in waiting if place_of(f.effect) in members]
    return waiting[0] if waiting else None


def leaders_of(found: Found) -> list[Fit]:
    """Single effects whose company is looked for, the best first; of a place and kind once.

    Beside a second effect the best of them need not be right, so that others get their turn: unless
    they leave FAR more than it does.
    """
    ranked = [found.finalists[i] for i in np.argsort(lag(found.finalists))]
    single = [f for f in ranked if f.effect.at and len(f.effect.parts()) == 1]
    least = min((f.per_value for f in single), default=np.inf)
    single = [f for f in single if f.per_value <= FAR * least]
    if found.finalists[0].per_value < FAR * least:  # none takes most of what refitting leaves
        left = [fit for _, _, fit in sorted(found.left, key=lambda left: left[1])]
        single += [f for f in left if f.effect.at and len(f.effect.parts()) == 1]
    leaders: dict[Place, Fit] = {}
    for f in single:
        leaders.setdefault(place_of(f.effect), f)
    return list(leaders.values())
