"""Explanations that no structure is: a bearing, link or foot that gives as slowly as a damper.

A drive's controller, a brake that slips or rubber yields slowly, with a stiffness that goes with
frequency. Over a band that is what a spring does beside a damper far larger than any structure has.
"""

import numpy as np

from planner.diagnosis.linear.fit import Fit, follow
from planner.diagnosis.thresholds import DAMPER_WORTH, LOSS_OF_NO_STRUCTURE, STIFFNESS_KNOWN

STIFF = 1.5  # prior sds above its median where a spring changes little


def as_structure(fit: Fit, none: Fit, temper: float) -> Fit | None:
    """The fit, if need be with its springs that are like dampers stiff instead.

    None where those explain a part of what `none` leaves, χ² counting 1/`temper`. A spring that
    FRFs tell only together with another, in series, may become a damper for next to nothing.
    """
    slow = _damper_like(fit, temper)
    if not slow:
        return fit
    x, misfit = fit.x.copy(), fit.misfit
    for spring, damper in slow:
        x[spring] = misfit.mean[spring] + STIFF * misfit.sd[spring]
        if damper is not None:
            x[damper] = misfit.mean[damper]
    if not misfit.possible(x):
        return None
    stiff = follow(misfit, x)
    nothing, some, all_ = (f.log_evidence(temper) for f in (none, stiff, fit))
    worth = all_ - some > DAMPER_WORTH * (all_ - nothing)
    return None if worth or _damper_like(stiff, temper) else stiff


def _damper_like(fit: Fit, temper: float) -> list[tuple[int, int | None]]:
    """Which springs of an effect, added or loosened, are mostly dampers mid-band; their dampers.

    Only of springs that FRFs tell.
    """
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
            out.append((k, c))
    return out
