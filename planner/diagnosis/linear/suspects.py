"""Where a robot gives and what it carries, from one fit in which it may do so everywhere.

One effect after the other finds no way home where several are there: beside the first, the second
looks like something else. Here all soft structures and added masses are free at once, stiff and
massless unless the data want them otherwise; the logarithm of the FRFs is fitted in a band that
widens. What gave or carries then, few places, is fitted alone from there, and where that is not
enough, with a resonator beside it.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from planner.diagnosis.effects.added_mass import AddedMass
from planner.diagnosis.effects.combined import Both, Family, together
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.effects.extra_compliance import ExtraCompliance
from planner.diagnosis.effects.local_resonator import LocalResonator
from planner.diagnosis.linear.fit import Fit, approached, points
from planner.diagnosis.linear.problem import GLANCE, Problem
from planner.fit.held_out import farthest_first
from planner.inference.parallel import side_by_side

ROUGH = replace(GLANCE, lines=24, inertial=False)
POSES = 5
BANDS = (0.28, 12), (1.0, 30)  # shares of the band, one after the other, and steps in each
DAMPERS_HELD = 1.6  # e^sd of stated dampers; chosen
FOLLOWED = 20  # steps of what is left alone
GAVE = -0.4  # prior sds from stiff at which a spring is said to give
CARRIED = 0.25  # prior sds of mass at which a link is said to carry something
MOST = 4  # places that give, looked at together
MASSES = 2  # places that give, at most, beside which each mass is looked at


def suspects(problem: Problem, effects: Sequence[Effect]) -> tuple[Fit, ...]:
    """Rough fits of few effects each, from the one of all; none where the library has no such."""
    few = _few(problem)
    all_ = _everything(problem, effects)
    if not all_.members:
        return ()
    low, high = problem.band_hz
    x, found = None, None
    for share, steps in BANDS:
        part = replace(few, band_hz=(low, low + share * (high - low)))
        misfit = part.misfit(all_, ROUGH)
        found = approached(misfit, [misfit.mean if x is None else x], steps)
        x = found.x
    assert found is not None
    return tuple(side_by_side(partial(_alone, few, found), _sets(found, effects)))


def resonant(problem: Problem, rough: Sequence[Fit], effects: Sequence[Effect]) -> tuple[Fit, ...]:
    """Rough fits of each resonator beside what each of some `suspects` has."""
    few = _few(problem)
    resonators = [e for e in effects if isinstance(e, LocalResonator)]
    pairs = [
        (suspect, pair)
        for suspect in rough
        for e in resonators
        if (pair := together(suspect.effect, e)) is not None
    ]
    return tuple(side_by_side(partial(_both_from, few), pairs))


def _alone(problem: Problem, everywhere: Fit, effect: Effect) -> Fit:
    """A rough fit of few effects from where all are, or with the largest mass of all as theirs."""
    misfit = problem.misfit(effect, GLANCE)
    x = points(misfit, everywhere)[0]
    shifts = everywhere.named()
    carried = [shifts[_mass(e)] for e in everywhere.effect.parts() if isinstance(e, AddedMass)]
    other = x.copy()
    for e in effect.parts():
        if isinstance(e, AddedMass):
            other[misfit.names.index(_mass(e))] = max(carried, key=abs)
    return approached(misfit, [x, other] if misfit.possible(other) else [x], FOLLOWED)


def _mass(effect: Effect) -> str:
    return f"mass of {effect.name} at {effect.at}"


def _both_from(problem: Problem, both: tuple[Fit, Effect]) -> Fit:
    """A rough fit of an effect from where another is, and from the starts of what is new."""
    fit, effect = both
    misfit = problem.misfit(effect, GLANCE)
    return approached(misfit, points(misfit, fit), FOLLOWED)


def _few(problem: Problem) -> Problem:
    """The poses that are farthest apart, with dampers that are held where few steps have to do."""
    priors = replace(problem.priors, damping_factor=DAMPERS_HELD)
    return replace(problem.at(farthest_first(problem.q)[:POSES].tolist()), priors=priors)


def _everything(problem: Problem, effects: Sequence[Effect]) -> Family:
    """Each place once with all that may give there beside the others, and all masses."""
    widest: dict[tuple[str, str], ExtraCompliance] = {}
    for e in effects:
        if isinstance(e, ExtraCompliance):
            known = widest.get((e.name, e.at))
            if known is None or len(e.gives) > len(known.gives):
                widest[e.name, e.at] = e
    soft: list[Effect] = []
    for one in map(_stiff, widest.values()):
        if problem.able(_family([*soft, one])):
            soft.append(one)
    return _family([*soft, *(e for e in effects if isinstance(e, AddedMass))])


def _family(members: Sequence[Effect]) -> Family:
    quantities = tuple(q for m in members for q in m.quantities)
    return Family(" and ".join(m.at for m in members), quantities, tuple(members))


def _stiff(effect: ExtraCompliance) -> ExtraCompliance:
    """The same with its prior's median where that ended: it gives if the data want it."""
    gives = tuple(replace(g, upper=g.upper**2 / g.lower) for g in effect.gives)
    return replace(effect, gives=gives)


def _sets(found: Fit, effects: Sequence[Effect]) -> list[Effect]:
    """The softest place, the softest two, …; some of them with one mass."""
    shift = dict(
        zip(found.misfit.names, (found.x - found.misfit.mean) / found.misfit.sd, strict=True)
    )
    softness: dict[tuple[str, str], float] = {}
    for e in found.effect.parts():
        own = [shift[n] for n in e.springs(found.misfit.setting.simulation) if "stiffness" in n]
        if own and min(own) < GAVE:
            softness[e.name, e.at] = min(own)
    gave = [
        _variant(place, shift, found, effects)
        for place in sorted(softness, key=lambda p: softness[p])
    ]
    masses = [e for e in effects if isinstance(e, AddedMass)]
    carried = [abs(shift[_mass(e)]) for e in masses]
    sets = [tuple(gave[:k]) for k in range(1, min(len(gave), MOST) + 1)]
    if max(carried, default=0.0) > CARRIED:
        some = [tuple(gave[:k]) for k in range(min(len(gave), MASSES) + 1)]
        sets += [(*soft, mass) for soft in some for mass in masses]
    return [one[0] if len(one) == 1 else Both.of(*one) for one in sets]


def _variant(
    place: tuple[str, str], shift: dict[str, float], found: Fit, effects: Sequence[Effect]
) -> Effect:
    """The smallest variant of an effect at a place that has all that gave there."""
    simulation = found.misfit.setting.simulation
    variants = [e for e in effects if (e.name, e.at) == place]

    def given(e: Effect) -> int:
        return sum(shift[n] < GAVE for n in e.springs(simulation) if "stiffness" in n)

    return max(variants, key=lambda e: (given(e), -len(e.springs(simulation))))
