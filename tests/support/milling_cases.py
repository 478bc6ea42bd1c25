"""Cuts of the literature and their limits, found by other methods than the planner's."""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from planner.milling.cut import Cut
from planner.milling.cutter_modes import CutterModes, real_modes
from planner.milling.machine import Machine, semi_monodromies

# Insperger and Stépán's mode, as Ding et al. (2010) use it.
HERTZ, ZETA, KILOGRAM = 922.0, 0.011, 0.03993
SPEEDS = (5000.0, 7500.0, 10000.0, 15000.0, 20000.0)

# |µ| of the slot at 5000 rpm by depth in mm: Chebyshev collocation with 70 points.
MULTIPLIERS = {0.2: 0.819743, 0.5: 1.073976, 0.7: 1.221556, 1.0: 1.406474}

# First loss from zero in mm at SPEEDS, by milling and radial immersion; where it is a flip.
ONE_MODE: dict[tuple[str, float], tuple[tuple[float, ...], tuple[bool, ...]]] = {
    ("slot", 1.0): ((0.4086, 0.3206, 0.3224, 0.3866, 1.4175), (False,) * 4 + (True,)),
    ("down", 0.05): ((2.2069, 2.6226, 4.0907, 8.2125, 2.2987), (False, True, True, True, False)),
    ("up", 0.05): ((2.1462, 1.6642, 1.6577, 1.888, 3.774), (False,) * 4 + (True,)),
}
TWO_EQUAL = (0.0475, 0.0548, 0.0714, 0.1144, 0.0632)  # of two such modes, x and y, slot


GIVEN: dict[str, Any] = {
    "teeth": 2, "diameter_m": 0.02, "milling": "slot", "radial_immersion": 1.0, "kt_n_m2": 6e8,
    "kr_n_m2": 2e8, "feed": (1.0, 0.0, 0.0), "axis": (0.0, 0.0, 1.0),
    "spindle_rpm": (5000.0, 20000.0, 4), "depth_m": (0.0, 0.01, 400),
    "method": "full_discretisation",
}  # fmt: skip


def cut(**changes: Any) -> Cut:
    """A slot with two teeth, or what is changed of it."""
    return Cut(**(GIVEN | changes))


def cut_toml(**changes: Any) -> str:
    """The same as text of cut.toml."""
    return "".join(f"{key} = {json.dumps(value)}\n" for key, value in (GIVEN | changes).items())


def modes_toml(
    hertz: Sequence[float], damping: Sequence[float], mass_kg: Sequence[float],
    direction: Sequence[Sequence[float]],
) -> str:  # fmt: skip
    """Modes of a structure as text of modes.toml."""
    rows = zip(hertz, damping, mass_kg, direction, strict=True)
    return "".join(
        f"[[mode]]\nfrequency_hz = {f}\ndamping_ratio = {z}\nmass_kg = {m}\ndirection = {list(d)}\n"
        for f, z, m, d in rows
    )


def one_mode(direction: tuple[float, float] = (1.0, 0.0)) -> CutterModes:
    """The mode of the literature in the plane of the cut."""
    return real_modes(*map(np.atleast_1d, (HERTZ, ZETA, KILOGRAM)), np.array([direction]))


def two_equal() -> CutterModes:
    """That mode in both directions."""
    return real_modes(*(np.full(2, v) for v in (HERTZ, ZETA, KILOGRAM)), np.eye(2))


def two_each_way() -> CutterModes:
    """Two modes along x and two along y, by their stiffness."""
    hertz = np.array([456.78, 1448.89, 516.52, 1408.45])
    zeta = np.array([0.1117, 0.01704, 0.02458, 0.03136])
    stiffness = np.array([7.933e6, 14.692e6, 9.375e6, 12.406e6])
    along = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    return real_modes(hertz, zeta, stiffness / (2 * np.pi * hertz) ** 2, along)


def semi_growth(machine: Machine, rpm: float, depth: float) -> float:
    """Largest |µ| at a speed and a depth in m, by semi-discretisation."""
    (built,) = semi_monodromies(machine, rpm, 2.0)(np.array([depth]))
    return float(np.max(np.abs(np.linalg.eigvals(built))))
