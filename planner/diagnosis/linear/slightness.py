"""Effects that are there and too slight to name: without them the simulation is nearly the same.

Every robot has bearings that give, links that bend and gears that ripple a little. Recordings of
little noise tell them by hundreds of nats, which says that they are there, not that they matter.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np
from scipy.stats import norm

from planner.diagnosis.effects.combined import Both
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.fit import LAST_STEPS, Fit, carried_on
from planner.diagnosis.linear.problem import Problem
from planner.diagnosis.thresholds import LEFT_FACTOR

FOLLOWED = 1e-3  # shares below it are left where they are


def without_slight(
    fits: Sequence[Fit], told: Sequence[Sequence[Effect]], shares: np.ndarray, matters: float
) -> np.ndarray:
    """Shares (k,) of fits on the same lines, those of effects that do not matter given on.

    `told` are the effects by which each fit is called. A fit gives as much as FRFs say that one of
    them changes less than `matters` of them once the rest is refitted; the fit without it takes it.
    """
    called = [frozenset((e.name, e.at) for e in effects if e.at) for effects in told]
    shares = np.array(shares, dtype=float)
    for i in sorted(range(len(fits)), key=lambda i: -len(called[i])):
        if shares[i] < FOLLOWED:
            continue
        kept = {(e.name, e.at) for e in told[i] if e.absorbed}
        fewer = [
            j
            for j in range(len(fits))
            if len(called[i]) == len(called[j]) + 1
            and called[j] < called[i]
            and not (called[i] - called[j]) & kept
        ]
        if not fewer:
            continue
        changes = [change(fits[j], fits[i]) for j in fewer]
        least = int(np.argmin(changes))
        told_of = float(
            norm.cdf(np.log(max(changes[least], 1e-12) / matters) / np.log(LEFT_FACTOR))
        )
        shares[fewer[least]] += (1 - told_of) * shares[i]
        shares[i] *= told_of
    return shares


def thinned(problem: Problem, whole: Fit, fits: Sequence[Fit]) -> list[Fit]:
    """Fits without one effect of `whole`, then without a second, and so on: the slightest first.

    Those among `fits` may have come from elsewhere and stopped in another minimum: each is followed
    from `whole` too.
    """
    known = {frozenset(f.effect.parts()): f for f in fits}
    made: list[Fit] = []
    while len(parts := whole.effect.parts()) > 1:
        # What refitting takes the place of changes nothing, and says nothing of the others.
        sets = [[p for p in parts if p is not part] for part in parts if not part.absorbed]
        if not sets:
            break
        for kept in sets:
            again, key = _carried_on(problem, whole, kept), frozenset(kept)
            if key not in known or _value(again) < _value(known[key]):
                known[key] = again
                made.append(again)
        whole = min((known[frozenset(kept)] for kept in sets), key=partial(change, whole=whole))
    return made


def _value(fit: Fit) -> float:
    return fit.misfit(fit.x).value


def _carried_on(problem: Problem, whole: Fit, kept: Sequence[Effect]) -> Fit:
    return carried_on(problem, whole, Both.of(*kept) if len(kept) > 1 else kept[0], LAST_STEPS)


def change(without: Fit, whole: Fit) -> float:
    """Root mean square by which two fits' FRFs differ, relative to those that were measured."""
    used = whole.misfit.weight > 0
    difference = (whole.misfit.parts(whole.x)[0] - without.misfit.parts(without.x)[0])[used]
    measured = whole.misfit.measured.accelerance[used]
    return float(np.sqrt(np.sum(np.abs(difference) ** 2) / np.sum(np.abs(measured) ** 2)))
