"""What a fit says of a mass or a resonator, asked again at all other places.

On the neighbouring link it is nearly the same, and a fit that began there does not leave it.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from planner.diagnosis.effects.combined import Both, together
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.fit import CLOSE, Fit, Problem, approached, points
from planner.inference.parallel import side_by_side

MOVABLE = MASS, RESONATOR = "added_mass", "local_resonator"
KEPT = "mass", "frequency", "damping_ratio"  # where and which way is asked anew


def elsewhere(problem: Problem, fit: Fit, effects: Sequence[Effect]) -> tuple[Fit, ...]:
    """Rough fits with each of its movable effects at each other place."""
    moves: list[tuple[Effect, Effect, Effect]] = []
    for part in fit.effect.parts():
        rest = [p for p in fit.effect.parts() if p is not part]
        for to in effects:
            if part.name not in MOVABLE or to.name != part.name or to.at == part.at:
                continue
            effect = together(Both.of(*rest), to) if rest else to
            if effect is not None:
                moves.append((part, to, effect))
    return tuple(side_by_side(partial(_moved, problem, fit), moves))


def _moved(problem: Problem, fit: Fit, move: tuple[Effect, Effect, Effect]) -> Fit:
    part, to, effect = move
    misfit, known = problem.misfit(effect, CLOSE), fit.named()
    starts = np.array(points(misfit, fit))
    for name in KEPT:
        before, now = f"{name} of {part.name} at {part.at}", f"{name} of {to.name} at {to.at}"
        if before in known:
            starts[:, misfit.names.index(now)] = known[before]
    return approached(misfit, list(np.unique(starts, axis=0)))


def rigid(problem: Problem, fit: Fit, effects: Sequence[Effect]) -> tuple[Fit, ...]:
    """Rough fits with a mass in the stead of each resonator.

    One that swings faster than the band is wide is nothing else, and a fit does not get there by
    itself.
    """
    pairs: list[tuple[Effect, Effect]] = []
    for part in fit.effect.parts():
        if part.name == RESONATOR:
            rest = [p for p in fit.effect.parts() if p is not part]
            there = [e for e in effects if e.name == MASS and e.at == part.at]
            both = (together(Both.of(*rest), e) if rest else e for e in there)
            pairs += [(part, effect) for effect in both if effect is not None]
    return tuple(side_by_side(partial(_held, problem, fit), pairs))


def _held(problem: Problem, fit: Fit, pair: tuple[Effect, Effect]) -> Fit:
    part, effect = pair
    misfit, known = problem.misfit(effect, CLOSE), fit.named()
    x = points(misfit, fit)[0]
    for q in part.quantities:
        now = f"{q.name} of {MASS} at {part.at}"
        if now in misfit.names:
            x[misfit.names.index(now)] = q.value(known[f"{q.name} of {part.name} at {part.at}"])
    return approached(misfit, [x])
