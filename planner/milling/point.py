"""One point of a stability diagram: its largest multiplier, as exact as it is said to be."""

from dataclasses import dataclass

import numpy as np

from planner.milling.machine import Machine, multipliers

FINER = 1.5  # factor on the points, until they suffice
EXACT = 1e-7  # relative change of |µ| up to which points per period are added
MOST_CHIPS = 600  # points of a period: beyond them eigenvalues take minutes


@dataclass(frozen=True)
class Multiplier:
    """Largest |µ| over one period (of a tooth, or of a turn where pitches differ), its error."""

    size: float
    error: float


def multiplier(machine: Machine, rpm: float, depth_m: float) -> Multiplier:
    """At a speed in rpm and a depth in m, with points added until it stays."""
    factor, before = FINER, np.inf
    while True:
        built = machine.monodromies(rpm, factor)(np.array([depth_m]))
        size = float(np.abs(multipliers(built)[0]))
        error = abs(size - before)
        if error < EXACT * size or built[0].shape[0] * FINER > MOST_CHIPS:
            return Multiplier(size, error)
        factor, before = factor * FINER, size
