"""Limits of the literature's cuts, converged: stability is first lost at these depths.

Lobes beside what knows nothing of them: steps in time, closed form, other discretisations.

Milling step by step in time: a check of the lobes that shares nothing with them but the modes.

What is stepped is the deviation from the forced vibration, which every tooth repeats and which
so leaves the chip as it is. Each tooth cuts down to where it is; it cuts nothing where it is above
the surface that the teeth before it left, and the static force is then missing (loss of contact).
"""

import numpy as np
import pytest

from planner.errors import InputError
from planner.milling.cut import Cut
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
SLOW = pytest.mark.slow


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


STEPS_PER_RADIAN = 12.0  # of the fastest mode
DISTURBED = 1e-4  # of the feed per tooth: the deviation that is begun with
LOST = 0.3  # of the feed per tooth: a deviation that has grown so far is chatter
ROUNDING = 1e-10  # of the feed: a deviation below this has died out
BAND = 0.03  # about the limit, within which a simulation of finite length need not tell


def dies_out(
    modes: CutterModes, cut: Cut, rpm: np.ndarray, depth_m: np.ndarray, passes: int = 150
) -> np.ndarray:
    """(p,) bool at points of speed and depth; modes in the plane of the cut, equal teeth."""
    fastest = float(np.max(np.abs(modes.poles))) * 60 / (float(np.min(rpm)) * cut.teeth)
    count = int(max(90, np.ceil(STEPS_PER_RADIAN * fastest)))  # steps of a tooth's period
    step = 60 / (rpm * cut.teeth * count)
    half, whole = (np.exp(modes.poles * step[:, None] * share) for share in (0.5, 1.0))
    phi = 2 * np.pi / cut.teeth * (np.arange(cut.teeth)[:, None] + (np.arange(count) + 0.5) / count)
    inside = (phi >= cut.immersion_rad[0]) & (phi <= cut.immersion_rad[1])
    normal = np.stack([np.sin(phi), np.cos(phi)], axis=-1)  # (teeth, count, 2)
    along = np.stack([-np.cos(phi), np.sin(phi)], axis=-1)
    push = cut.kt_n_m2 * along - cut.kr_n_m2 * normal
    begun = np.random.default_rng(0).standard_normal((len(modes.poles), 2)) @ [1, 1j]
    z = np.tile(DISTURBED * begun / np.abs(2 * modes.shapes).max(axis=1), (len(rpm), 1))
    surface = np.tile(-np.sin(phi)[..., None], len(rpm))  # one feed before the first pass
    force, peak = np.zeros((len(rpm), 2)), np.zeros((passes, len(rpm)))
    for passed, i in np.ndindex(passes, count):
        drive = force @ modes.drives.T / modes.poles
        u = ((z * half + drive * (half - 1)) @ (2 * modes.shapes)).real
        force = np.zeros_like(force)
        for j in np.flatnonzero(inside[:, i]):
            at = np.sin(phi[j, i]) * passed + u @ normal[j, i]
            chip = np.maximum(at - surface[j, i], 0.0)
            surface[j, i] = np.maximum(surface[j, i], at)
            force += (depth_m * (chip - np.sin(phi[j, i])))[:, None] * push[j, i]
        z = z * whole + force @ modes.drives.T / modes.poles * (whole - 1)
        peak[passed] = np.maximum(peak[passed], np.abs(u).max(axis=1))
    early, late = (part.max(axis=0) for part in np.array_split(peak[passes // 2 :], 2))
    return ((late < early) | (late < ROUNDING)) & (peak.max(axis=0) < LOST)


@pytest.mark.parametrize(
    ("modes", "given", "points"),
    [
        (one_mode(), cut(), 8),
        (two_each_way(), cut(milling="down", radial_immersion=0.5, teeth=3), 8),
        pytest.param(one_mode(), cut(milling="up", radial_immersion=0.05), 60, marks=SLOW),
        pytest.param(
            two_equal(), cut(milling="down", radial_immersion=0.3, teeth=4), 60, marks=SLOW
        ),
    ],
)
def test_steps_in_time_say_the_same(modes: CutterModes, given: Cut, points: int):
    asked, random = Machine(modes, given), np.random.default_rng(3)
    rpm = random.uniform(8000, 20000, points)
    depth = asked.floor().floor_m * random.uniform(0.5, 3, points)
    each = list(zip(rpm, depth, strict=True))
    below, said, above = (
        np.array([multiplier(asked, s, share * b)[0] < 1 for s, b in each])
        for share in (1 - BAND, 1.0, 1 + BAND)
    )
    with np.errstate(all="ignore"):
        alike = (dies_out(modes, given, rpm, depth) == said)[below == above]
    assert np.mean(alike) >= (1 if points < 60 else 0.99)


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
