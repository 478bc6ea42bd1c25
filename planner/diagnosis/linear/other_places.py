"""What a fit says of a mass or a resonator, asked again at all other places.

On the neighbouring link it is nearly the same, and a fit that began there does not leave it.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from planner.diagnosis.effects.combined import Both, together
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.effects.places import links
from planner.diagnosis.linear.fit import Fit, approached, fit, points, settle
from planner.diagnosis.linear.problem import CLOSE, Problem
from planner.diagnosis.thresholds import INERTIA_HIDES, INERTIA_STRAYED, TIED
from planner.inference.parallel import side_by_side

MOVABLE = MASS, RESONATOR = "added_mass", "local_resonator"
HEAVY = -0.8, 0.8  # prior sds of a mass that is begun with beside bent inertias
KEPT = "mass", "frequency", "damping_ratio"  # where and which way is asked anew


def elsewhere(problem: Problem, found: Fit, effects: Sequence[Effect]) -> tuple[Fit, ...]:
    """Rough fits with each of its movable effects at each other place."""
    moves: list[tuple[Effect, Effect, Effect]] = []
    for part in found.effect.parts():
        rest = [p for p in found.effect.parts() if p is not part]
        for to in effects:
            if part.name not in MOVABLE or to.name != part.name or to.at == part.at:
                continue
            effect = together(Both.of(*rest), to) if rest else to
            if effect is not None:
                moves.append((part, to, effect))
    return tuple(side_by_side(partial(_moved, problem, found), moves))


def _moved(problem: Problem, found: Fit, move: tuple[Effect, Effect, Effect]) -> Fit:
    part, to, effect = move
    misfit, known = problem.misfit(effect, CLOSE), found.named()
    starts = np.array(points(misfit, found))
    # From springs and inertias that made up for the wrong place nothing leads to the right one.
    usual = starts.copy()
    usual[:, : misfit.split[1]] = misfit.mean[: misfit.split[1]]
    starts = np.concatenate([starts, usual])
    for name in KEPT:
        before, now = f"{name} of {part.name} at {part.at}", f"{name} of {to.name} at {to.at}"
        if before in known:
            starts[:, misfit.names.index(now)] = known[before]
    return approached(misfit, list(np.unique(starts, axis=0)))


def inertias_bent(found: Fit) -> bool:
    """Whether a fit moved inertias far, so that they may hide what the simulation lacks."""
    return farthest_bent(found)[1] > INERTIA_STRAYED


def farthest_bent(fit: Fit) -> tuple[str, float]:
    """The link whose mass, centre or moments a fit moved farthest, and by how many prior sds."""
    a, b = fit.misfit.split
    if a == b:
        return "", 0.0
    away = np.abs((fit.x - fit.misfit.mean) / fit.misfit.sd)[a:b]
    most = int(np.argmax(away))
    body = fit.misfit.names[a + most].split(" of ", 1)[1]
    named = {joint: link.replace("_", " ") for link, joint in links(fit.misfit.setting.simulation)}
    return named.get(body, body), float(away[most])


def named_as_mass(fits: Sequence[Fit], shares: Sequence[float]) -> list[float]:
    """Shares of fits, that of the first, which has no effect, given to a mass that it hides.

    So it is where the first is the likeliest, but bends a link's inertias farther than any robot's
    are off (INERTIA_HIDES), and a mass on that link explains as much.
    """
    out, (link, away) = list(shares), farthest_bent(fits[0])
    masses = [
        i
        for i, f in enumerate(fits)
        if [(p.name, p.at.replace("_", " ")) for p in f.effect.parts()] == [(MASS, link)]
    ]
    most = max(masses, key=lambda i: shares[i], default=0)
    if out[0] < max(out) or away < INERTIA_HIDES or not masses or out[most] < TIED * out[0]:
        return out
    out[0], out[most] = 0.0, out[most] + out[0]
    return out


def burdened(problem: Problem, found: Fit, effects: Sequence[Effect]) -> tuple[Fit, ...]:
    """Rough fits with one mass at each place, where inertias were moved far to imitate one.

    From a fit that has bent them nothing leads to the mass: each is fitted from afar too.
    """
    if not inertias_bent(found):
        return ()
    masses = [e for e in effects if e.name == MASS]
    rest = [p for p in found.effect.parts() if p.at and p.name != MASS]
    if rest:
        masses = [t for e in masses if (t := together(Both.of(*rest), e)) is not None]
    return tuple(side_by_side(partial(_from_afar, problem, found), masses))


def _from_afar(problem: Problem, found: Fit, effect: Effect) -> Fit:
    # Valleys from inertias to a mass are long: a fit that stops early is still on its way.
    far, misfit = fit(problem, effect, [found], CLOSE), problem.misfit(effect, CLOSE)
    x, place = points(misfit, found)[0], misfit.names.index(f"mass of {MASS} at {_mass_at(effect)}")
    starts = [np.where(np.arange(len(x)) == place, s * misfit.sd[place], x) for s in HEAVY]
    # Either way has its own valley: the one that is steeper at first need not be the deeper one.
    ends = [approached(misfit, [start]) for start in starts if misfit.possible(start)]
    return min((settle(problem, one, CLOSE) for one in (far, *ends)), key=lambda f: f.value)


def _mass_at(effect: Effect) -> str:
    return next(p.at for p in effect.parts() if p.name == MASS)


def rigid(problem: Problem, found: Fit, effects: Sequence[Effect]) -> tuple[Fit, ...]:
    """Rough fits with a mass in the stead of each resonator.

    One that swings faster than the band is wide is nothing else, and a fit does not get there by
    itself.
    """
    pairs: list[tuple[Effect, Effect]] = []
    for part in found.effect.parts():
        if part.name == RESONATOR:
            rest = [p for p in found.effect.parts() if p is not part]
            there = [e for e in effects if e.name == MASS and e.at == part.at]
            both = (together(Both.of(*rest), e) if rest else e for e in there)
            pairs += [(part, effect) for effect in both if effect is not None]
    return tuple(side_by_side(partial(_held, problem, found), pairs))


def _held(problem: Problem, found: Fit, pair: tuple[Effect, Effect]) -> Fit:
    part, effect = pair
    misfit, known = problem.misfit(effect, CLOSE), found.named()
    x = points(misfit, found)[0]
    for q in part.quantities:
        now = f"{q.name} of {MASS} at {part.at}"
        if now in misfit.names:
            x[misfit.names.index(now)] = q.value(known[f"{q.name} of {part.name} at {part.at}"])
    return approached(misfit, [x])
