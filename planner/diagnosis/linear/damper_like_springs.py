"""Explanations that no structure is: a bearing, link or foot that gives as slowly as a damper.

A drive's controller, a brake that slips or rubber yields slowly, with a stiffness that goes with
frequency. Over a band that is what a spring does beside a damper far larger than any structure has.
"""

import numpy as np

from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.thresholds import LOSS_OF_NO_STRUCTURE, STIFFNESS_KNOWN


def damper_like(fit: Fit, temper: float) -> bool:
    """Whether a spring of an effect, added or loosened, is mostly a damper mid-band.

    Only of springs that FRFs tell, χ² counting 1/`temper`.
    """
    misfit = fit.misfit
    added = {n for part in fit.effect.parts() for n in part.springs(misfit.setting.simulation)}
    springs = [n for n in added if n.startswith("stiffness of ")]
    if not springs:
        return False
    lines = misfit.measured.frequency_hz
    mid_rad_s = 2 * np.pi * float(np.sqrt(lines.min() * lines.max()))
    sd = np.sqrt(np.diagonal(np.linalg.inv(fit.precision(temper))))
    place = {name: i for i, name in enumerate(misfit.names)}
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
            return True
    return False
