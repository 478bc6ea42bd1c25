"""Limits of the literature's cuts, converged: stability is first lost at these depths."""

import numpy as np
import pytest

from planner.milling.lobes import losses
from planner.milling.machine import limits, multiplier
from tests.support.milling_cases import (
    MULTIPLIERS,
    ONE_MODE,
    SPEEDS,
    TWO_EQUAL,
    cut,
    machine,
    one_mode,
    two_each_way,
    two_equal,
)

CONVERGED, ZEROTH = 1e-3, 5e-3


@pytest.mark.parametrize("depth_mm", MULTIPLIERS)
def test_multiplier_of_a_point_is_converged(depth_mm: float):
    found = multiplier(machine(one_mode(), cut()), 5000.0, depth_mm * 1e-3)
    assert found.size == pytest.approx(MULTIPLIERS[depth_mm], abs=1e-6)
    assert found.error < 1e-6


@pytest.mark.parametrize("milling", ONE_MODE, ids=lambda m: m[0])
def test_first_loss_and_kind_of_one_mode(milling: tuple[str, float]):
    wanted, flips = ONE_MODE[milling]
    for speed, depth, flip in zip(SPEEDS, wanted, flips, strict=True):
        given = cut(milling=milling[0], radial_immersion=milling[1], spindle_rpm=(speed, speed, 1))
        (loss,) = losses(machine(one_mode(), given))
        assert 1e3 * loss.depth_m == pytest.approx(depth, rel=CONVERGED)
        assert loss.kind == ("flip" if flip else "hopf")


def test_first_loss_of_two_equal_modes():
    for speed, depth in zip(SPEEDS, TWO_EQUAL, strict=True):
        given = cut(spindle_rpm=(speed, speed, 1))
        (loss,) = losses(machine(two_equal(), given))
        assert 1e3 * loss.depth_m == pytest.approx(depth, rel=CONVERGED)
    assert 1e3 * machine(two_equal(), cut()).floor().floor_m == pytest.approx(0.0479, rel=ZEROTH)


def test_zeroth_order_of_two_modes_each_way():
    given = cut(
        milling="down", radial_immersion=0.5, kt_n_m2=1319.4e6, kr_n_m2=788.8e6,
        spindle_rpm=(4000.0, 16000.0, 7),
    )  # fmt: skip
    found = machine(two_each_way(), given).floor()
    assert 1e3 * found.floor_m == pytest.approx(0.957, rel=ZEROTH)
    assert found.floor_hz == pytest.approx(1440, rel=1e-3)
    depth, _ = limits(found, given.speeds_rpm, given.teeth)
    wanted = [1.086, 1.615, 1.139, 1.456, 0.958, 4.619, 1.040]
    np.testing.assert_allclose(1e3 * depth, wanted, rtol=ZEROTH)
