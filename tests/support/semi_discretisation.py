"""Growth by first-order semi-discretisation: the check of the full one."""

import numpy as np

from planner.milling.machine import Machine
from planner.milling.semi_discretisation import semi_monodromies, semi_monodromy


def semi_growth(machine: Machine, rpm: float, depth: float, count: int | None = None) -> float:
    """Largest |µ| at a speed and a depth in m, with `count` steps of a tooth's period."""
    if count is None:
        (built,) = semi_monodromies(machine, rpm, 2.0)(np.array([depth]))
    else:
        built = semi_monodromy(machine, rpm, count, depth)
    return float(np.max(np.abs(np.linalg.eigvals(built))))
