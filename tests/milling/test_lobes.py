"""Limits of the literature's cuts, converged: stability is first lost at these depths.

Lobes beside what knows nothing of them: closed form, another discretisation.
"""

import numpy as np
import pytest

from planner.errors import InputError
from planner.milling.cutter_modes import CutterModes
from planner.milling.lobes import stability_limits
from planner.milling.machine import Machine, limits, multiplier
from tests.support.milling_cases import (
    MULTIPLIERS,
    ONE_MODE,
    SPEEDS,
    TWO_EQUAL,
    cut,
    one_mode,
    semi_growth,
    two_each_way,
    two_equal,
)

CONVERGED, ZEROTH = 1e-3, 5e-3


@pytest.mark.parametrize("depth_mm", MULTIPLIERS)
def test_multiplier_of_a_point_is_converged(depth_mm: float):
    size, error = multiplier(Machine(one_mode(), cut()), 5000.0, depth_mm * 1e-3)
    assert size == pytest.approx(MULTIPLIERS[depth_mm], abs=1e-6)
    assert error < 1e-6


LITERATURE = [
    *((one_mode(), milling, *wanted) for milling, wanted in ONE_MODE.items()),
    (two_equal(), ("slot", 1.0), TWO_EQUAL, None),
]


@pytest.mark.parametrize(("modes", "milling", "wanted", "flips"), LITERATURE)
def test_first_loss_and_its_kind(modes, milling, wanted, flips):
    for k, speed in enumerate(SPEEDS):
        given = cut(milling=milling[0], radial_immersion=milling[1], spindle_rpm=(speed, speed, 1))
        (loss,) = stability_limits(Machine(modes, given))
        assert 1e3 * loss.depth_m == pytest.approx(wanted[k], rel=CONVERGED)
        assert flips is None or loss.kind == ("flip" if flips[k] else "hopf")


def test_zeroth_order_of_two_modes_each_way():
    assert 1e3 * Machine(two_equal(), cut()).floor().floor_m == pytest.approx(0.0479, rel=ZEROTH)
    given = cut(
        milling="down", radial_immersion=0.5, kt_n_m2=1319.4e6, kr_n_m2=788.8e6,
        spindle_rpm=(4000.0, 16000.0, 7),
    )  # fmt: skip
    found = Machine(two_each_way(), given).floor()
    assert 1e3 * found.floor_m == pytest.approx(0.957, rel=ZEROTH)
    assert found.floor_hz == pytest.approx(1440, rel=1e-3)
    depth, _ = limits(found, given.speeds_rpm, given.teeth)
    wanted = [1.086, 1.615, 1.139, 1.456, 0.958, 4.619, 1.040]
    np.testing.assert_allclose(1e3 * depth, wanted, rtol=ZEROTH)


def test_one_degree_of_freedom_in_closed_form():
    """The floor is −1/(2 K_s Re G) at its least, K_s the mean coefficient along the mode."""
    found = Machine(one_mode(), cut()).floor()
    hertz = np.linspace(900, 960, 200_001)
    real = one_mode().receptance(hertz)[:, 0, 0].real.min()
    k_s = 2e8 / 2  # a slot's mean of sin φ (K_t cos φ + K_r sin φ) with two teeth
    assert found.floor_m == pytest.approx(-1 / (2 * k_s * real), rel=5e-3)


@pytest.mark.parametrize("helix_deg", [0.0, 30.0])
def test_semi_discretisation_agrees(helix_deg: float):
    given = {
        "teeth": 3, "milling": "up", "radial_immersion": 0.3, "helix_deg": helix_deg,
        "depth_m": (0.0, 0.02, 10), "spindle_rpm": (20000.0, 20000.0, 1),
    }  # fmt: skip
    structure = Machine(two_each_way(), cut(**given))
    (loss,) = stability_limits(structure)
    for share, unstable in ((0.997, False), (1.003, True)):
        assert (semi_growth(structure, 20000.0, share * loss.depth_m) > 1) == unstable
    (other,) = stability_limits(Machine(two_each_way(), cut(**given, method="semi_discretisation")))
    assert other.depth_m == pytest.approx(loss.depth_m, rel=2e-3)
    assert other.kind == loss.kind
    assert other.chatter_hz == pytest.approx(loss.chatter_hz, rel=1e-3)


def test_semi_discretisation_takes_teeth_at_equal_angles_only():
    given = cut(method="semi_discretisation", pitch_deg=[170.0, 190.0], teeth=2)
    with pytest.raises(InputError, match="equal angles only; choose the method full_discr"):
        stability_limits(Machine(two_each_way(), given))


def test_pitches_that_hardly_differ_change_nothing_and_others_do():
    def depth(pitch_deg: list[float] | None) -> float:
        given = cut(
            teeth=3, milling="up", radial_immersion=0.3, pitch_deg=pitch_deg,
            depth_m=(0.0, 0.02, 10), spindle_rpm=(20000.0, 20000.0, 1),
        )  # fmt: skip
        return stability_limits(Machine(two_each_way(), given))[0].depth_m

    even = depth(None)
    assert depth([120.00001, 119.99999, 120.0]) == pytest.approx(even, rel=1e-5)
    assert abs(depth([100.0, 130.0, 130.0]) / even - 1) > 0.05


def test_the_cut_turned_with_its_frame_stays_as_it_is():
    """Feed and axis turned with the modes: only what they are to each other matters."""
    random = np.random.default_rng(2)
    turn = np.linalg.qr(random.standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    modes = two_each_way()
    flat = np.zeros((4, 3), complex), np.zeros((4, 3), complex)
    flat[0][:, :2], flat[1][:, :2] = modes.shapes, modes.drives
    whole = CutterModes(modes.poles, flat[0] @ turn.T, flat[1] @ turn.T, np.zeros((3, 3)))
    given = {"milling": "down", "radial_immersion": 0.5, "spindle_rpm": (9000.0, 9000.0, 1)}
    turned = cut(**given, feed=tuple(turn[:, 0]), axis=tuple(turn[:, 2]))
    found = Machine(whole.in_plane(turned.plane), turned)
    straight = stability_limits(Machine(modes, cut(**given)))[0]
    assert stability_limits(found)[0].depth_m == pytest.approx(straight.depth_m, rel=1e-6)


def test_no_depth_is_as_stable_as_the_structure():
    at_rest, _ = multiplier(Machine(one_mode(), cut()), 5000.0, 0.0)
    pole = one_mode().poles[0]
    assert at_rest == pytest.approx(np.exp(pole.real * 60 / (2 * 5000)), rel=1e-9)
