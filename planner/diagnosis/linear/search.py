"""The search for what explains FRFs: all candidates roughly, few of them closely."""

from collections.abc import Sequence
from functools import partial

from planner.diagnosis.effects.base_compliance import BaseCompliance
from planner.diagnosis.effects.combined import Both, families, together
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.effects.local_resonator import LocalResonator
from planner.diagnosis.linear.beams import as_beams
from planner.diagnosis.linear.evidence import best_of, lag
from planner.diagnosis.linear.fit import (
    SETTLED,
    Fit,
    carried_on,
    settle,
    staged,
)
from planner.diagnosis.linear.found import Found, distinct
from planner.diagnosis.linear.leaders import (
    FEW_EFFECTS,
    Place,
    best_of_few,
    leaders_of,
    next_leader,
    place_of,
)
from planner.diagnosis.linear.other_places import burdened, elsewhere, inertias_bent, rigid
from planner.diagnosis.linear.problem import CLOSE, Problem
from planner.diagnosis.linear.rounds import (
    HOPELESS,
    LAST,
    LAST_STEPS,
    STEPS,
    carried_from,
    one_round,
    settled,
)
from planner.diagnosis.linear.second_resonators import next_door, second_resonators
from planner.diagnosis.linear.stated_values import strayed
from planner.diagnosis.linear.suspects import resonant, suspects
from planner.diagnosis.linear.three_axis_resonators import hung, three_axis_resonators
from planner.diagnosis.thresholds import AT_NOISE, PAYS
from planner.inference.parallel import side_by_side
from planner.progress import Tell, quietly, within

MOST_LEADERS = 5  # single effects whose company is looked for, while nothing fits
MOST_LEADERS_BENT = 2  # the same, where a nonlinear joint keeps anything from fitting
POINTED = 2  # suspects settled on all lines
MOVED = 2  # effects at other places, the same
EXCHANGED = 2  # pairs with another effect in the stead of one, the same
TILTS = 2  # of a base, that rounds fit closely enough
LESSENED = 3  # explanations that are looked at without one of their effects
MOST_EFFECTS = 5  # at once, where each pays


def search(
    problem: Problem,
    refitted: Fit,
    effects: Sequence[Effect],
    tell: Tell,
    *,
    bent: bool = False,
) -> Found:
    """Fit all effects beside `refitted`, the fit of none, and pairs where one is not enough.

    `bent`: the FRFs are averages over swings of a nonlinear joint, so that no effects will fit as
    closely as noise allows: fewer pairs are looked for, and no third effect.
    """
    most_leaders = MOST_LEADERS_BENT if bent else MOST_LEADERS
    if not effects:
        return Found((settle(problem, refitted, CLOSE, STEPS),), ())
    found = one_round(problem, refitted, effects, within(tell, 0.0, 0.6))
    found = _loosened(problem, refitted, found, effects)
    found = _widened(problem, found, effects)
    if best_of_few(found).per_value > AT_NOISE:
        tell("letting it give and carry everywhere", 0.6)
        found = Found((*found.finalists, *_pointed(problem, found, effects)), found.left)
        swinging = settled(problem, hung(problem, effects))
        found = Found((*found.finalists, *swinging), found.left)
        found = _lessened(problem, found)
    leaders = leaders_of(found) if best_of_few(found).per_value > AT_NOISE else []
    led: list[Place] = []
    while len(led) < most_leaders and (leader := next_leader(leaders, led, found)) is not None:
        first = 0.6 + 0.4 * len(led) / most_leaders
        led.append(place_of(leader.effect))
        pairs = [p for e in effects if (p := together(leader.effect, e)) is not None]
        along = within(tell, first, first + 0.4 / most_leaders)
        more = one_round(problem, leader, pairs, along)
        kept = tuple(f for f in more.finalists if len(f.effect.parts()) > 1)
        found = Found((*found.finalists, *kept), (*found.left, *more.left))
    found = _moved(problem, found, effects)
    if not bent:
        found = exchanged(problem, found, effects)
    found = _hanging(problem, found, () if bent else effects)
    if not bent:
        found = _composed(problem, found, effects, tell)
    found = _lessened(problem, _rigid(problem, found, effects))
    found = _spared(problem, _accompanied(problem, found, effects, tell), effects)
    return distinct(_burdened(problem, found, effects))


def _pointed(problem: Problem, found: Found, effects: Sequence[Effect]) -> tuple[Fit, ...]:
    """The best of `suspects`, of resonators beside them, and of families, followed to the end.

    Where a resonator is the best of single effects, its company is looked for anyway.
    """
    rough = suspects(problem, effects)
    # The softest place comes first: alone it may be all, though more places fit more closely.
    ends = _followed(problem, rough)
    ends += side_by_side(partial(staged, problem), list(filter(problem.able, families(effects))))
    missed = bool(ends) and min(f.per_value for f in ends) > AT_NOISE
    if missed and not isinstance(leaders_of(found)[0].effect, LocalResonator):
        ends += _followed(problem, resonant(problem, _and_best(rough, 1), effects), first=False)
    return tuple(ends)


def _loosened(problem: Problem, refitted: Fit, found: Found, effects: Sequence[Effect]) -> Found:
    """Adds the stiffness of each joint whose spring refitting moved far, followed from afar.

    A spring far from its stated value bends all else first: few steps lead nowhere from there.
    """
    if refitted.per_value <= AT_NOISE:
        return found
    moved = [e for e in effects if strayed(refitted, e)]
    return Found((*found.finalists, *side_by_side(partial(staged, problem), moved)), found.left)


def _widened(problem: Problem, found: Found, effects: Sequence[Effect]) -> Found:
    """Adds all that a base may give, and links that bend as beams, where the best has not enough.

    It leaves something then, or bends inertias. Few steps lead to few of many springs.
    """
    best = best_of_few(found)
    if best.per_value <= AT_NOISE and not inertias_bent(best):
        return found
    near = settled(problem, as_beams(problem, found.finalists))
    if best.per_value > AT_NOISE:
        bases = (e for e in effects if isinstance(e, BaseCompliance) and len(e.gives) > TILTS)
        near += [staged(problem, e) for e in bases if problem.able(e)]
    return Found((*found.finalists, *near), found.left)


def _followed(problem: Problem, rough: Sequence[Fit], first: bool = True) -> list[Fit]:
    """The best rough fits (with `first`, the first one too), the best of them on all lines."""
    few = _and_best(rough, LAST) if first else best_of(rough, LAST)
    return settled(problem, best_of(settled(problem, few, CLOSE, STEPS), POINTED))


def _and_best(rough: Sequence[Fit], most: int) -> list[Fit]:
    """The first fit, and the `most` best ones."""
    return list({id(f): f for f in (*rough[:1], *best_of(rough, most))}.values())


def _moved(problem: Problem, found: Found, effects: Sequence[Effect]) -> Found:
    """Adds fits whose masses and resonators stand elsewhere, where the best has not enough.

    It misses the noise then, or bends inertias.
    """
    if not _lacks(found, bent=True):
        return found
    best = min(found.finalists, key=lambda f: f.per_value)
    near = best_of(elsewhere(problem, best, effects), MOVED)
    return Found((*found.finalists, *settled(problem, near)), found.left)


def _hanging(problem: Problem, found: Found, effects: Sequence[Effect]) -> Found:
    """Adds fits with resonators on three springs, while the best has not enough.

    Without effects to choose from those alone that are known to swing along one direction.
    """
    if _lacks(found):
        near = settled(problem, three_axis_resonators(problem, found.finalists))
        found = Found((*found.finalists, *near), found.left)
    if _lacks(found, bent=True):
        near = settled(problem, next_door(problem, found.finalists, effects))
        found = Found((*found.finalists, *near), found.left)
    if effects and _lacks(found):
        near = settled(problem, second_resonators(problem, found.finalists))
        found = Found((*found.finalists, *near), found.left)
    return found


def _lacks(found: Found, *, bent: bool = False) -> bool:
    """Whether the best misses the noise, or with `bent` moves inertias far to reach it."""
    best = min(found.finalists, key=lambda f: f.per_value)
    return best.per_value > AT_NOISE or (bent and inertias_bent(best))


def exchanged(problem: Problem, found: Found, effects: Sequence[Effect]) -> Found:
    """Adds pairs in which another effect stands for one of the best pair's.

    A wrong effect may have led the fit near the minimum of the right one, so each other effect is
    begun where the pair ended; also where that is at the noise: the right one is closer still.
    """
    best = min(found.finalists, key=lambda f: f.per_value)
    parts = best.effect.parts()
    if len(parts) != FEW_EFFECTS or any(p.artefact for p in parts):
        return found
    near: list[Fit] = []
    for kept in parts:
        others = (e for e in effects if e not in parts)
        pairs = [p for e in others if (p := together(kept, e)) is not None]
        near += best_of(carried_from(problem, best, pairs), EXCHANGED)
    return Found((*found.finalists, *settled(problem, near)), found.left)


def _rigid(problem: Problem, found: Found, effects: Sequence[Effect]) -> Found:
    """Adds fits in which the best's resonators are replaced by masses that do not swing."""
    best = min(found.finalists, key=lambda f: f.value)
    return Found((*found.finalists, *settled(problem, rigid(problem, best, effects))), found.left)


def _composed(problem: Problem, found: Found, effects: Sequence[Effect], tell: Tell) -> Found:
    """Adds one effect after the other while each lowers the misfit and noise is not reached."""
    single = min(f.per_value for f in found.finalists if len(f.effect.parts()) == 1)
    best, before = min(found.finalists, key=lambda f: f.per_value), single
    while AT_NOISE < best.per_value < 1 + (before - 1) / PAYS:
        if len(best.effect.parts()) == MOST_EFFECTS:
            break
        more = [t for e in effects if (t := together(best.effect, e)) is not None]
        tell("looking for more effects", 0.97)
        grown = one_round(problem, best, more, quietly)
        before = best.per_value
        found = Found((*found.finalists, *grown.finalists[1:]), (*found.left, *grown.left))
        best = min(found.finalists, key=lambda f: f.per_value)
    return found


def _accompanied(problem: Problem, found: Found, effects: Sequence[Effect], tell: Tell) -> Found:
    """Adds pairs of one effect that explains nearly everything and each other effect.

    Noise that is overstated hides a small second effect from `AT_NOISE`, not from the evidence.
    """
    best = min(found.finalists, key=lambda f: f.value)
    if not best.effect.at or len(best.effect.parts()) > 1 or best.per_value > AT_NOISE:
        return found
    if lag([found.finalists[0], best])[0] < HOPELESS:  # nothing at all does nearly as well
        return found
    tell("looking for a small second effect", 0.98)
    pairs = [t for e in effects if (t := together(best.effect, e)) is not None]
    if not pairs:
        return found
    more = one_round(problem, best, pairs, quietly)
    return Found((*found.finalists, *more.finalists[1:]), (*found.left, *more.left))


def _lessened(problem: Problem, found: Found) -> Found:
    """Adds the best explanations without one of their effects each, fitted from where they are.

    An effect may have led the fit out of a wrong minimum and then explain nothing itself.
    """
    there = [f for f in found.finalists if f.effect.at]
    less: list[tuple[Fit, Effect]] = []
    for whole in sorted(there, key=lambda f: f.value)[:LESSENED]:
        parts = whole.effect.parts()
        for part in parts:
            kept = [p for p in parts if p is not part]
            effect = Both.of(*kept) if len(kept) > 1 else kept[0] if kept else Effect("")
            less.append((whole, effect))
    again = side_by_side(partial(_carried_on, problem), less)
    return Found((*found.finalists, *again), found.left)


def _spared(problem: Problem, found: Found, effects: Sequence[Effect]) -> Found:
    """Adds pairs of the best with the stiffness of each joint whose springs it moved far."""
    best = min(found.finalists, key=lambda f: f.value)
    if not best.effect.at or best.per_value > AT_NOISE:
        return found
    spared = [e for e in effects if strayed(best, e)]
    pairs = [p for e in spared if (p := together(best.effect, e)) is not None]
    more = side_by_side(partial(_carried_on, problem), [(best, pair) for pair in pairs])
    return Found((*found.finalists, *more), found.left)


def _burdened(problem: Problem, found: Found, effects: Sequence[Effect]) -> Found:
    """Adds a mass at each place where the best moved inertias far to explain everything."""
    best = min(found.finalists, key=lambda f: f.value)
    if any(p.artefact for p in best.effect.parts()):  # what is beside one may be all there is
        found = distinct(_lessened(problem, found))
    robots = [f for f in found.finalists if not any(p.artefact for p in f.effect.parts())]
    best = min(robots, key=lambda f: f.value)
    if best.per_value > AT_NOISE:
        return found
    near = best_of(burdened(problem, best, effects), LAST)
    return Found((*found.finalists, *settled(problem, near, steps=SETTLED[1])), found.left)


def _carried_on(problem: Problem, pair: tuple[Fit, Effect]) -> Fit:
    return carried_on(problem, *pair, LAST_STEPS)
