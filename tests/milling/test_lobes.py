"""Limits of the literature's cuts, converged: stability is first lost at these depths.

Lobes beside what knows nothing of them: steps in time, closed form, other discretisations.

Milling step by step in time: a check of the lobes that shares nothing with them but the modes.

What is stepped is the deviation from the forced vibration, which every tooth repeats and which
so leaves the chip as it is. Each tooth cuts down to where it is; it cuts nothing where it is above
the surface that the teeth before it left, and the static force is then missing (loss of contact).
"""

from dataclasses import dataclass

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
    machine,
    one_mode,
    semi_growth,
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
        (loss,) = stability_limits(machine(one_mode(), given))
        assert 1e3 * loss.depth_m == pytest.approx(depth, rel=CONVERGED)
        assert loss.kind == ("flip" if flip else "hopf")


def test_first_loss_of_two_equal_modes():
    for speed, depth in zip(SPEEDS, TWO_EQUAL, strict=True):
        given = cut(spindle_rpm=(speed, speed, 1))
        (loss,) = stability_limits(machine(two_equal(), given))
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


STEPS_PER_RADIAN = 12.0  # of the fastest mode
LEAST_STEPS = 90  # of a tooth's period
DISTURBED = 1e-4  # of the feed per tooth: the deviation that is begun with
LOST = 0.3  # of the feed per tooth: a deviation that has grown so far is chatter
ROUNDING = 1e-10  # of the feed: a deviation below this has died out
JUDGED = 0.5  # share of the teeth that pass, at the end, over which growth is judged


@dataclass(frozen=True, eq=False)
class Simulated:
    """Largest deviation (teeth, points) while each tooth passes, in feeds per tooth."""

    peak: np.ndarray

    @property
    def stable(self) -> np.ndarray:
        """(points,) bool: whether the deviation dies out."""
        with np.errstate(all="ignore"):
            size = np.log(np.maximum(self.peak, 1e-280))
        last = size[-int(JUDGED * len(size)) :]
        middle = len(last) // 2
        falls = last[middle:].max(axis=0) < last[:middle].max(axis=0)
        gone = self.peak[-1] < ROUNDING
        return (falls | gone) & (np.max(self.peak, axis=0) < LOST)


def simulate(
    modes: CutterModes, cut: Cut, rpm: np.ndarray, depth_m: np.ndarray, teeth: int, seed: int = 0
) -> Simulated:
    """At points (p,) of speed and depth, while so many teeth pass.

    Modes in the plane of the cut; teeth at equal angles, without helix.
    """
    count = _steps(modes, cut, float(np.min(rpm)))
    step = 60 / (np.asarray(rpm) * cut.teeth * count)  # (p,) s
    whole, half = (_transition(modes, step * share) for share in (1.0, 0.5))
    pitch = 2 * np.pi / cut.teeth
    phi = np.mod(pitch * np.arange(cut.teeth)[:, None] + pitch * (np.arange(count) + 0.5) / count,
                 2 * np.pi)  # fmt: skip
    start, end = cut.immersion_rad
    inside = (phi >= start) & (phi <= end)
    normal = np.stack([np.sin(phi), np.cos(phi)], axis=-1)  # (teeth, count, 2)
    kt, kr = cut.kt_n_m2, cut.kr_n_m2
    push = np.stack([-kt * np.cos(phi) - kr * np.sin(phi), kt * np.sin(phi) - kr * np.cos(phi)], -1)
    random = np.random.default_rng(seed)
    shown = 2 * modes.shapes  # (k, 2)
    z = np.repeat(random.standard_normal((1, len(modes.poles), 2)) @ [1, 1j], len(step), axis=0)
    z *= DISTURBED / np.abs(shown).max(axis=1)
    surface = np.zeros((cut.teeth, count, len(step)))
    surface -= np.sin(phi)[..., None]  # one feed before the first pass
    peak = np.zeros((teeth, len(step)))
    force = np.zeros((len(step), 2))
    depth = np.asarray(depth_m)
    with np.errstate(all="ignore"):
        for passed in range(teeth):
            for i in range(count):
                ahead = z * half[0] + (force @ modes.drives.T) * half[1]
                u = (ahead @ shown).real
                force = np.zeros_like(force)
                for j in np.flatnonzero(inside[:, i]):
                    at = np.sin(phi[j, i]) * passed + u @ normal[j, i]
                    chip = np.maximum(at - surface[j, i], 0.0)
                    surface[j, i] = np.maximum(surface[j, i], at)
                    change = depth * (chip - np.sin(phi[j, i]))
                    force += change[:, None] * push[j, i]
                z = z * whole[0] + (force @ modes.drives.T) * whole[1]
                size = np.abs(u).max(axis=1)
                peak[passed] = np.maximum(peak[passed], size)
    return Simulated(np.where(np.isfinite(peak), peak, np.inf))


def _steps(modes: CutterModes, cut: Cut, slowest_rpm: float) -> int:
    angle = float(np.max(np.abs(modes.poles))) * 60 / (slowest_rpm * cut.teeth)
    return int(max(LEAST_STEPS, np.ceil(STEPS_PER_RADIAN * angle)))


def _transition(modes: CutterModes, step_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(p, k) each: what is left of a state after a step, and what a force of 1 adds meanwhile."""
    left = np.exp(modes.poles * step_s[:, None])
    return left, (left - 1) / modes.poles


BAND = 0.03  # about the limit, within which a simulation of finite length need not tell
WANTED = [
    (one_mode(), cut()),
    (one_mode(), cut(milling="up", radial_immersion=0.05)),
    (two_each_way(), cut(milling="down", radial_immersion=0.5, teeth=3)),
    (two_equal(), cut(milling="down", radial_immersion=0.3, teeth=4)),
]


def agreement(modes: CutterModes, given: Cut, points: int, seed: int) -> np.ndarray:
    """Of random points outside the band: whether time and lobes say the same."""
    asked = machine(modes, given)
    random = np.random.default_rng(seed)
    rpm = random.uniform(8000, 20000, points)
    depth = asked.floor().floor_m * random.uniform(0.5, 3, points)

    def stable(factor: float) -> np.ndarray:
        found = [multiplier(asked, s, factor * b).size for s, b in zip(rpm, depth, strict=True)]
        return np.array(found) < 1

    clear = stable(1 - BAND) == stable(1 + BAND)
    said = stable(1.0)
    return (simulate(modes, given, rpm, depth, 150).stable == said)[clear]


@pytest.mark.parametrize("case", [0, 2])
def test_steps_in_time_say_the_same(case: int):
    assert np.mean(agreement(*WANTED[case], points=8, seed=3)) == 1


@pytest.mark.slow
def test_steps_in_time_say_the_same_at_many_points():
    found = np.concatenate([agreement(*case, points=60, seed=5) for case in WANTED])
    print(f"{np.sum(found)} of {len(found)} points alike")
    assert len(found) >= 200
    assert np.mean(found) >= 0.99


def test_one_degree_of_freedom_in_closed_form():
    """The floor is −1/(2 K_s Re G) at its least, K_s the mean coefficient along the mode."""
    found = machine(one_mode(), cut()).floor()
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
    structure = machine(two_each_way(), cut(**given))
    (loss,) = stability_limits(structure)
    for share, unstable in ((0.997, False), (1.003, True)):
        assert (semi_growth(structure, 20000.0, share * loss.depth_m) > 1) == unstable
    (other,) = stability_limits(machine(two_each_way(), cut(**given, method="semi_discretisation")))
    assert other.depth_m == pytest.approx(loss.depth_m, rel=2e-3)
    assert other.kind == loss.kind
    assert other.chatter_hz == pytest.approx(loss.chatter_hz, rel=1e-3)


def test_semi_discretisation_takes_teeth_at_equal_angles_only():
    given = cut(method="semi_discretisation", pitch_deg=[170.0, 190.0], teeth=2)
    with pytest.raises(InputError, match="equal angles only; choose the method full_discr"):
        stability_limits(machine(two_each_way(), given))


def test_pitches_that_hardly_differ_change_nothing_and_others_do():
    def depth(pitch_deg: list[float] | None) -> float:
        given = cut(
            teeth=3, milling="up", radial_immersion=0.3, pitch_deg=pitch_deg,
            depth_m=(0.0, 0.02, 10), spindle_rpm=(20000.0, 20000.0, 1),
        )  # fmt: skip
        return stability_limits(machine(two_each_way(), given))[0].depth_m

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
    straight = stability_limits(machine(modes, cut(**given)))[0]
    assert stability_limits(found)[0].depth_m == pytest.approx(straight.depth_m, rel=1e-6)


def test_no_depth_is_as_stable_as_the_structure():
    at_rest = multiplier(machine(one_mode(), cut()), 5000.0, 0.0)
    pole = one_mode().poles[0]
    assert at_rest.size == pytest.approx(np.exp(pole.real * 60 / (2 * 5000)), rel=1e-9)
