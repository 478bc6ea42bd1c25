"""Effects that are there and too slight to name: without them the simulation is nearly the same.

Every robot has bearings that give, links that bend and gears that ripple a little. Recordings of
little noise tell them by hundreds of nats, which says that they are there, not that they matter.
"""

from collections.abc import Sequence
from functools import lru_cache, partial

import numpy as np
from scipy.special import expit
from scipy.stats import norm

from planner.diagnosis.effects.combined import Both
from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.fit import LAST_STEPS, Fit, carried_on
from planner.diagnosis.linear.mismatch import residuals
from planner.diagnosis.linear.objective import Misfit
from planner.diagnosis.linear.problem import Problem
from planner.diagnosis.thresholds import (
    ERRORS_SPREAD,
    LEFT_FACTOR,
    NAMED_FROM,
    SOMETHING_UNKNOWN,
    SPRING_STRAYED,
)

FOLLOWED = 1e-3  # shares below it are left where they are
AS_GOOD = 0.8  # of the largest part that a fit gives on: those that take so much do as well; chosen


def without_slight(
    fits: Sequence[Fit],
    told: Sequence[Sequence[Effect]],
    shares: np.ndarray,
    prior: Sequence[float],
    bent: np.ndarray,
    evidence: np.ndarray,
    matters: float,
) -> np.ndarray:
    """Shares (k,) of fits to the same lines, moved to simpler fits where an effect is too small.

    The first fit is "none"; `told` are each fit's effects, `prior` (k,) their weights before any
    data, `bent` (k,) how far each fit moved the stated values (see `Weights`), `evidence` (k,) its
    log evidence. An effect is too small if, with everything else refitted, it changes the FRFs by
    less than NAMED_FROM of what `matters`. The more surely that is so, the more of the fit's share
    moves to the fit without the effect; of several that do as well, to the likeliest. Where both
    fits have nearly the same FRFs, the prior decides between them: the farther the simpler fit had
    to move the stated values, the likelier is the effect.
    """
    pull = np.logaddexp(np.log1p(-SOMETHING_UNKNOWN), np.log(SOMETHING_UNKNOWN) + bent)
    called = [frozenset((e.name, e.at) for e in effects if e.at) for effects in told]
    shares = np.array(shares, dtype=float)
    for i in sorted(range(len(fits)), key=lambda i: -len(called[i])):
        if shares[i] < FOLLOWED:
            continue
        fewer = [j for j in range(len(fits)) if called[j] < called[i]]
        if not fewer:
            continue
        given = [
            (1 - _above(_size(fits[j], fits[i], _more(told[i], called[j])), NAMED_FROM * matters))
            * expit(np.log(prior[j] / prior[i]) + pull[i] - pull[j])
            for j in fewer
        ]
        as_good = [k for k, g in enumerate(given) if g >= AS_GOOD * max(given)]
        most = max(as_good, key=lambda k: evidence[fewer[k]])
        shares[fewer[most]] += given[most] * shares[i]
        shares[i] *= 1 - given[most]
    return shares


def _more(told: Sequence[Effect], others: frozenset) -> list[Effect]:
    return [e for e in told if e.at and (e.name, e.at) not in others]


def _size(without: Fit, whole: Fit, parts: Sequence[Effect]) -> float:
    """`change`; of what is a stated spring's own value, by that, where it is far from stated.

    Artefacts are told by their size beyond what chains have, and change nothing once those are out.
    """
    if any(part.artefact for part in parts):
        return np.inf
    misfit, x = whole.misfit, whole.x.copy()
    simulation, before = misfit.setting.simulation, without.misfit
    far = False
    for name in (n for part in parts if part.absorbed for n in part.springs(simulation)):
        if name not in before.names:  # of a bearing that gives beside it: not stated
            continue
        here, stated = misfit.names.index(name), before.names.index(name)
        away = x[here] - before.mean[stated]
        far = far or abs(away) > SPRING_STRAYED * before.sd[stated]
        x[here] = before.mean[stated]
    return _apart(residuals(misfit, x)[1], whole) if far else change(without, whole)


def _above(size: float, limit: float) -> float:
    """Probability that a size counts as above a limit: neither is known better than by a factor."""
    return float(norm.cdf(np.log(max(size, 1e-12) / limit) / np.log(LEFT_FACTOR)))


def thinned(problem: Problem, whole: Fit, fits: Sequence[Fit]) -> list[Fit]:
    """Fits without one effect of `whole`, then without a second, and so on: the slightest first.

    Those among `fits` may have come from elsewhere and stopped in another minimum: each is followed
    from `whole` too.
    """
    known = {frozenset(f.effect.parts()): f for f in fits}
    made: list[Fit] = []
    while len(parts := whole.effect.parts()) > 1:
        # What refitting takes the place of changes nothing, and says nothing of the others.
        lasting = [part for part in parts if not part.absorbed] or parts
        sets = [[p for p in parts if p is not part] for part in lasting]
        for kept in sets:
            again, key = _fitted_without(problem, whole, fits[0], kept), frozenset(kept)
            if key not in known or _value(again) < _value(known[key]):
                known[key] = again
                made.append(again)
        whole = min((known[frozenset(kept)] for kept in sets), key=partial(change, whole=whole))
    return made


def _fitted_without(problem: Problem, whole: Fit, none: Fit, kept: Sequence[Effect]) -> Fit:
    """Of what is `kept` of a whole; from no effect at all where the whole leads nowhere."""
    again = _carried_on(problem, whole, kept)
    if _value(again) <= _value(none):
        return again
    return min((again, _carried_on(problem, none, kept)), key=_value)


def _value(fit: Fit) -> float:
    return fit.value


def _carried_on(problem: Problem, whole: Fit, kept: Sequence[Effect]) -> Fit:
    return carried_on(problem, whole, Both.of(*kept) if len(kept) > 1 else kept[0], LAST_STEPS)


def change(without: Fit, whole: Fit) -> float:
    """Root mean square by which two fits' FRFs differ, relative to those that were measured.

    Each fit's FRFs include the tilts, offsets and gains that are likeliest for it. What those can
    imitate therefore does not count as a difference.
    """
    return _apart(_left(without), whole)


@lru_cache(maxsize=64)
def _left(fit: Fit) -> np.ndarray:
    return residuals(fit.misfit, fit.x)[1]


def _apart(left: np.ndarray, whole: Fit) -> float:
    """The larger of two sizes: of all FRFs together, where peaks count, and of each by itself."""
    misfit, difference = whole.misfit, (_left(whole) - left) * _noise(whole.misfit)
    each = np.abs(difference[misfit.weight > 0]) ** 2 / _squares(misfit)
    together = _relative(np.abs(difference) ** 2, misfit)
    return max(together, float(np.sqrt(np.mean(each))))


def _squares(misfit: Misfit) -> np.ndarray:
    """Squares of the FRFs that were measured, those in every direction (ERRORS_SPREAD) added.

    What is lost in noise does not count: a difference as large as that matters as little.
    """
    measured, used = misfit.measured, misfit.weight > 0
    size = np.abs(measured.accelerance) ** 2 * used
    matters = misfit.setting.simulation.robot.config.diagnose.matters
    count = np.maximum(used.sum(axis=(1, 2), keepdims=True), 1)
    spread = size.sum(axis=(1, 2), keepdims=True) / count
    own = 0.0 if measured.noise_sd is None else measured.noise_sd
    noise = np.where(used, own, 0.0) / matters
    return (size + ERRORS_SPREAD**2 * spread + noise**2)[used]


def _noise(misfit: Misfit) -> np.ndarray:
    """(n, r, c, F) in m/s²/N, √2 of which is usual; 0 where nothing was measured."""
    weight = misfit.weight
    return np.divide(1.0, weight, where=weight > 0, out=np.zeros_like(weight))


def _relative(squares: np.ndarray, misfit: Misfit) -> float:
    """Root of the sum of squares (n, r, c, F) over that of what was measured."""
    used = misfit.weight > 0
    measured = np.sum(np.abs(misfit.measured.accelerance[used]) ** 2)
    return float(np.sqrt(np.sum(squares[used]) / measured))
