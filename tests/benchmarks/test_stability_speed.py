"""How fast methods of stability converge, and what they cost at the same error."""

import numpy as np
import pytest

from planner.milling.machine import Machine, multipliers
from planner.milling.period import period
from tests.support.milling_cases import MULTIPLIERS, cut, one_mode, semi_growth

RPM, DEPTH_MM = 5000.0, 0.5


def full_error(asked: Machine, degree: int, elements: int) -> float:
    """Of |µ|, with polynomials of a degree on so many elements."""
    longest = np.pi / elements * (1 + 1e-9)
    built = period(asked.modes, asked.cut, RPM, degree, longest, 0.0)
    size = abs(multipliers(list(built.monodromy(np.array([DEPTH_MM * 1e-3]))))[0])
    return abs(size - MULTIPLIERS[DEPTH_MM])


def semi_error(asked: Machine, steps: int) -> float:
    """Of |µ|, with so many steps."""
    return abs(semi_growth(asked, RPM, DEPTH_MM * 1e-3, steps) - MULTIPLIERS[DEPTH_MM])


def test_orders_of_convergence():
    asked = Machine(one_mode(), cut())
    found = {
        "semi-discretisation": (semi_error(asked, 80), semi_error(asked, 160)),
        "full, degree 1": (full_error(asked, 1, 80), full_error(asked, 1, 160)),
        "full, degree 2": (full_error(asked, 2, 16), full_error(asked, 2, 32)),
        "full, degree 3": (full_error(asked, 3, 8), full_error(asked, 3, 16)),
    }
    order = {name: np.log2(coarse / fine) for name, (coarse, fine) in found.items()}
    print({name: round(float(value), 2) for name, value in order.items()})
    assert order["semi-discretisation"] == pytest.approx(2, abs=0.3)
    assert order["full, degree 1"] == pytest.approx(2, abs=0.3)
    assert order["full, degree 2"] > 3
    assert order["full, degree 3"] > 3
    # One element of a high degree: the error falls faster than any power.
    assert full_error(asked, 28, 1) < 1e-2 * full_error(asked, 22, 1)
