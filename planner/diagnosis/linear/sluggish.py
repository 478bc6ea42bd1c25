"""Explanations that no structure is: a bearing, link or foot that gives as slowly as a damper.

A drive's controller, a brake that slips or rubber yields slowly, with a stiffness that goes with
frequency. Over a band that is what a spring does beside a damper far larger than any structure has.
"""

import numpy as np

from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.thresholds import LOSS_OF_NO_STRUCTURE, STIFFNESS_KNOWN


def sluggish(fit: Fit, temper: float) -> bool:
    """Whether a spring that an effect adds, and that FRFs tell, is mostly a damper mid-band."""
    misfit = fit.misfit
    added = {n for part in fit.effect.parts() for n in part.springs(misfit.setting.simulation)}
    damped = [n for n in added if n.startswith("damping of ")]
    if not damped:
        return False
    lines = misfit.measured.frequency_hz
    mid_rad_s = 2 * np.pi * float(np.sqrt(lines.min() * lines.max()))
    sd = np.sqrt(np.diagonal(np.linalg.inv(fit.precision(temper))))
    place = {name: i for i, name in enumerate(misfit.names)}
    for damping in damped:
        stiffness = damping.replace("damping", "stiffness", 1)
        c, k = place.get(damping), place.get(stiffness)
        if c is None or k is None or sd[k] > STIFFNESS_KNOWN:
            continue
        if np.exp(fit.x[c] - fit.x[k]) * mid_rad_s > LOSS_OF_NO_STRUCTURE:
            return True
    return False
