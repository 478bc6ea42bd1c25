"""Explanations that no structure is: a bearing, link or foot that gives as slowly as a damper.

A drive's controller, a brake that slips or rubber yields slowly, with a stiffness that goes with
frequency. Over a band that is what a spring does beside a damper far larger than any structure has.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.diagnosis.linear.evidence import lag, temper_of
from planner.diagnosis.linear.fit import Fit, follow
from planner.diagnosis.thresholds import (
    DAMPER_ASIDE,
    DAMPER_WORTH,
    LOSS_OF_NO_STRUCTURE,
    STIFFNESS_KNOWN,
    TIED,
)

STIFF = 1.5  # prior sds above its median where a spring changes little
BEHIND = 500.0  # log evidence behind the best, from which a fit is left as it is


@dataclass(frozen=True)
class _Slow:
    """A spring that is like a damper: places in x of its stiffness and of what damps it."""

    spring: int
    damped_by: tuple[int, ...]


def as_structures(finalists: Sequence[Fit]) -> tuple[Fit, ...]:
    """Fits, those with springs like dampers with these stiff instead, where that loses little.

    A spring that FRFs tell only together with another, in series, may become a damper for next to
    nothing.
    """
    behind, t = lag(finalists), temper_of(finalists)
    return tuple(
        _as_structure(f, _without(f, finalists, t), t) if far < BEHIND else f
        for f, far in zip(finalists, behind, strict=True)
    )


def _without(fit: Fit, finalists: Sequence[Fit], temper: float) -> Fit:
    """The best fit without one of the effects whose springs are like dampers."""
    others = [f for f in finalists if _spared(f, fit, temper)]
    return max(others or finalists[:1], key=lambda f: f.log_evidence(temper))


def _spared(other: Fit, fit: Fit, temper: float) -> bool:
    """Whether another fit has none of the effects of `fit` whose springs are like dampers."""
    names, simulation = fit.misfit.names, fit.misfit.setting.simulation
    slow = {names[s.spring] for s in _slow_springs(fit, temper)}
    parts = fit.effect.parts()
    there = {(p.name, p.at) for p in parts if slow.intersection(p.springs(simulation))}
    return there.isdisjoint((p.name, p.at) for p in other.effect.parts())


def _rest(other: Fit, fit: Fit, temper: float) -> bool:
    """Whether another fit has but effects of `fit`, none of them like a damper."""
    own, whole = ({(p.name, p.at) for p in f.effect.parts()} for f in (other, fit))
    return own < whole and _spared(other, fit, temper) and not damper_like(other, temper)


def beside_dampers(
    fits: Sequence[Fit], shares: Sequence[float] | np.ndarray, evidence: np.ndarray, temper: float
) -> np.ndarray:
    """Shares (k,) of fits, those with springs like dampers given to what they have beside these.

    So it is where the likeliest fit of the other effects of one explains nearly as much: that
    something is slow there too says nothing against them. The first fit is "none"; `evidence` (k,)
    is that of each.
    """
    out = np.array(shares, dtype=float)
    for i, one in enumerate(fits):
        if out[i] < TIED / len(fits) or not damper_like(one, temper):
            continue
        others = [k for k, f in enumerate(fits) if k and _rest(f, one, temper)]
        most = max(others, key=lambda k: evidence[k], default=i)
        lost, gained = evidence[i] - evidence[most], evidence[i] - evidence[0]
        if most != i and lost < DAMPER_ASIDE * gained:
            out[most], out[i] = out[most] + out[i], 0.0
    return out


def _as_structure(fit: Fit, without: Fit, temper: float) -> Fit:
    slow, misfit = _slow_springs(fit, temper), fit.misfit
    stated = [misfit.parametrisation.parameters[s.spring].stated for s in slow]
    if not slow or any(stated):  # a stated spring that is made stiff is another claim
        return fit
    x = fit.x.copy()
    for one in slow:
        x[one.spring] = misfit.mean[one.spring] + STIFF * misfit.sd[one.spring]
        x[list(one.damped_by)] = misfit.mean[list(one.damped_by)]
    if not misfit.possible(x):
        return fit
    stiff = follow(misfit, x)
    nothing, some, all_ = (f.log_evidence(temper) for f in (without, stiff, fit))
    little = all_ - some < DAMPER_WORTH * (all_ - nothing)
    return stiff if little and not damper_like(stiff, temper) else fit


def damper_like(fit: Fit, temper: float) -> bool:
    """Whether a spring of an effect, added or loosened, is mostly a damper mid-band.

    Only of springs that FRFs tell, χ² counting 1/`temper`.
    """
    return bool(_slow_springs(fit, temper))


def _slow_springs(fit: Fit, temper: float) -> list[_Slow]:
    misfit = fit.misfit
    added = {n for part in fit.effect.parts() for n in part.springs(misfit.setting.simulation)}
    springs = [n for n in added if n.startswith("stiffness of ")]
    if not springs:
        return []
    lines = misfit.measured.frequency_hz
    mid_rad_s = 2 * np.pi * float(np.sqrt(lines.min() * lines.max()))
    sd = np.sqrt(np.diagonal(np.linalg.inv(fit.precision(temper))))
    place, out = {name: i for i, name in enumerate(misfit.names)}, []
    for stiffness in springs:
        k = place.get(stiffness)
        if k is None or sd[k] > STIFFNESS_KNOWN:
            continue
        c, eta = (
            place.get(stiffness.replace("stiffness", kind, 1))
            for kind in ("damping", "loss_factor")
        )
        viscous = 0.0 if c is None else np.exp(fit.x[c] - fit.x[k]) * mid_rad_s
        structural = 0.0 if eta is None else np.exp(fit.x[eta])
        if viscous + structural > LOSS_OF_NO_STRUCTURE:
            out.append(_Slow(k, tuple(i for i in (c, eta) if i is not None)))
    return out
