"""Damping that is partly a loss factor: Maxwell branches whose losses hardly go with frequency."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.truth.deviation import Deviation, Spring

LOSS_BAND_HZ = 1.5, 300.0  # where a loss factor is nearly the same: all bands of the arms
BRANCHES = 5  # a factor of 3.8 apart: within the band the loss factor varies by a tenth
MIDDLE_HZ = 15.0  # where a loss factor takes as much as the viscous damping it replaces


def mixed(springs: Sequence[Spring], deviation: Deviation) -> list[Spring]:
    """Springs of which a drawn share of the damping is a loss factor's."""
    rng = np.random.default_rng([deviation.seed, 1])
    out = []
    for spring in springs:
        share = deviation.mixed * float(rng.random())
        loss = share * 2 * np.pi * MIDDLE_HZ * spring.damping / spring.stiffness
        out.append(replace(spring, damping=(1 - share) * spring.damping, loss=float(loss)))
    return out


def branches(springs: Sequence[Spring], stiffness: np.ndarray) -> list[tuple[int, float, float]]:
    """(spring, stiffness, rate in 1/s) of Maxwell branches beside springs of `stiffness` (e,)."""
    rates = 2 * np.pi * np.geomspace(*LOSS_BAND_HZ, BRANCHES)
    # Σ x / (1 + x²) over branches a ratio r apart is π / (2 ln r).
    each = 2 * np.log(rates[1] / rates[0]) / np.pi
    return [
        (j, float(each * spring.loss * stiffness[j]), float(rate))
        for j, spring in enumerate(springs)
        if spring.loss > 0
        for rate in rates
    ]
