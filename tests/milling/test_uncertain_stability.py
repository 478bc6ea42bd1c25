"""FRFs instead of modes, and what is not known: fits, samples, robust depths."""

import re
from dataclasses import replace

import numpy as np
import pytest

from planner.errors import InputError
from planner.frf.synthesis import convert
from planner.milling.cut import Cut
from planner.milling.cutter_frf import CutterFrf, of_accelerance
from planner.milling.cutter_modes import CutterFit, CutterModes, real_modes
from planner.milling.lobes import depths_of, sampled_limits, stability_limits
from planner.milling.machine import Machine
from planner.milling.structure import (
    Structure,
    explaining,
    limit_remarks,
    moved,
    of_frf,
    out_of_band_remark,
    sampled,
)
from tests.support.milling_cases import cut, one_mode, semi_growth, two_each_way

LINES = np.arange(200.0, 2400.0, 2.0)


def tip(modes: CutterModes, lines: np.ndarray = LINES, sd: float | None = None) -> CutterFrf:
    """FRFs as `predict` writes them, of modes in the plane x, y; z is not known."""
    h = np.full((3, 3, len(lines)), np.nan + 0j)
    h[:2, :2] = modes.receptance(lines).transpose(1, 2, 0)
    accelerance = convert(lines, h, "receptance", "accelerance")
    return of_accelerance("tip", lines, accelerance, None if sd is None else sd * abs(accelerance))


def crossed() -> CutterModes:
    """Modes whose cross FRFs differ, H_xy ≠ H_yx, with the compliance of modes above."""
    modes = two_each_way()
    random = np.random.default_rng(1)
    drives = modes.drives @ np.array([[1.0, 0.2], [-0.1, 1.0]])
    shapes = modes.shapes + 0.1 * random.standard_normal((4, 2))
    return CutterModes(modes.poles, shapes, drives, 5e-9 * np.array([[1.0, 0.2], [0.1, 0.8]]))


def check_limits(frf: CutterFrf, modes: CutterModes, given: Cut, rtol: float) -> Structure:
    """FRFs give the limits of their modes; returns what was found of them."""
    found = of_frf(frf, given)
    wanted = depths_of(stability_limits(Machine(modes, given)))
    depth = depths_of(stability_limits(found.machine(given)))
    np.testing.assert_allclose(depth, wanted, rtol=rtol)
    assert np.all(np.isfinite(wanted))
    return found


# Modes of 0.6 to 1.7 lines' width at 1 Hz.
SHARP = real_modes(
    np.array([12.0, 23.0, 41.0]), np.array([0.03, 0.025, 0.02]), np.array([300.0, 200, 150]),
    np.array([[1.0, 0.0], [0.0, 1.0], [0.6, 0.8]]),
)  # fmt: skip
# 0.9 Hz between modes of nearly one direction.
ALIKE = real_modes(
    np.array([81.6, 82.5]), np.array([0.02, 0.04]), np.array([15.0, 40.0]),
    np.array([[1.0, 0.0], [np.cos(0.15), np.sin(0.15)]]),
)  # fmt: skip
DOWN = {"milling": "down", "radial_immersion": 0.5}
SLOWLY = DOWN | {"kt_n_m2": 7e8, "spindle_rpm": (1200.0, 2400.0, 4), "depth_m": (0.0, 0.2, 100)}
WIDE = DOWN | {"spindle_rpm": (5000.0, 15000.0, 5), "depth_m": (0.0, 0.05, 10)}


@pytest.mark.parametrize("method", ["full_discretisation", "zeroth_order"])
@pytest.mark.parametrize(
    ("modes", "lines", "given", "rtol"),
    [
        (crossed(), LINES, WIDE, 2e-3),
        *((SHARP, step * np.arange(1, 121), SLOWLY, 1e-4) for step in (0.5, 1.0, 2.0)),
        (
            ALIKE, 1.81 * np.arange(1, 80),
            {"spindle_rpm": (2000.0, 8000.0, 4), "depth_m": (0.0, 0.5, 100)}, 1e-3,
        ),
    ],
)  # fmt: skip
def test_frfs_give_the_limits_of_their_modes(modes, lines, given, rtol, method):
    """Nothing is lost between lines, and modes that are alike stay two."""
    check_limits(tip(modes, lines), modes, cut(**given, method=method), rtol)


def test_methods_agree_on_cross_frfs_and_residual_compliance():
    given = {"milling": "down", "radial_immersion": 0.5, "spindle_rpm": (12000.0, 15000.0, 2)}
    soft = crossed()
    soft = CutterModes(soft.poles, soft.shapes, soft.drives, 20 * soft.residual)
    full = stability_limits(Machine(soft, cut(**given)))
    without = stability_limits(
        Machine(CutterModes(soft.poles, soft.shapes, soft.drives, 0 * soft.residual), cut(**given))
    )
    for rpm, a, c in zip(cut(**given).speeds_rpm, full, without, strict=True):
        for share, unstable in ((0.997, False), (1.003, True)):
            found = semi_growth(Machine(soft, cut(**given)), rpm, share * a.depth_m)
            assert (found > 1) == unstable
        assert abs(a.depth_m / c.depth_m - 1) > 0.01


@pytest.mark.parametrize(
    ("frf", "given", "words"),
    [
        (tip(one_mode(), np.arange(100.0, 700.0, 2.0)), cut(), "measure over the band"),
        (
            tip(two_each_way()), cut(feed=(0.0, 0.0, 1.0), axis=(1.0, 0.0, 0.0)),
            "lacks FRFs along z,",
        ),
    ],
)  # fmt: skip
def test_frfs_that_do_not_reach_or_lack_an_axis_are_refused(frf, given, words):
    with pytest.raises(InputError, match=words):
        of_frf(frf, given)


@pytest.mark.parametrize(("lacking", "taken"), [(((0, 1), (1, 0)), "0"), (((1, 0),), "xy")])
def test_cross_frfs_that_lack_are_taken_as_the_others_or_nothing_and_named(lacking, taken):
    """Machinists tap along feed and normal alone: xx and yy."""
    given, part = cut(milling="down", radial_immersion=0.5), tip(two_each_way())
    for i, j in lacking:
        part.receptance[i, j] = np.nan
    found = check_limits(part, two_each_way(), given, 1e-6)
    assert [f"lacks the FRF {'xy'[i]}{'xy'[j]}: it is taken as {taken}." in " ".join(found.remarks)
            for i, j in lacking] == [True] * len(lacking)  # fmt: skip


def test_what_lies_beyond_the_lines_is_said():
    """Chatter found there is a guess; where none is found, what was not measured may limit."""
    structure = of_frf(tip(one_mode()), cut())
    low, *_, high = structure.frf.frequency_hz
    inside = np.array([(low + high) / 2])
    assert out_of_band_remark(structure, inside) is None
    beyond = out_of_band_remark(structure, np.array([*inside, high + 1.0])) or ""
    assert "At 1 of the speeds the cut would chatter outside" in beyond
    unlimited = out_of_band_remark(structure, np.array([*inside, np.nan, np.nan])) or ""
    assert "At 2 of the speeds no mode within" in unlimited


def noisy(modes: CutterModes, lines: np.ndarray, share: float, seed: int) -> CutterFrf:
    """Measured: noise on every line alike, of a share of the largest accelerance."""
    h = modes.receptance(lines).transpose(1, 2, 0) * (2j * np.pi * lines) ** 2
    parts = np.random.default_rng(seed).standard_normal((2, *h.shape)) / np.sqrt(2)
    whole = np.full((3, 3, len(lines)), np.nan + 0j)
    whole[:2, :2] = h + share * np.abs(h).max() * (parts[0] + 1j * parts[1])
    return of_accelerance("tap", lines, whole, None)


def test_noise_is_sampled_as_wide_as_it_scatters():
    """Limits by other noises lie within the samples of one as often as these say."""
    given = cut(spindle_rpm=(9000.0, 12000.0, 3), method="zeroth_order")
    lines, modes = np.arange(2.0, 2200.0, 2.0), two_each_way()
    true = depths_of(stability_limits(Machine(modes, given)))
    inside = []
    for seed in range(8):
        found = of_frf(noisy(modes, lines, 0.003, 10 + seed), given)
        drawn = sampled_limits(
            found.samples(given, 40), stability_limits(found.machine(given))
        ).depth_m
        low, high = np.quantile(drawn, (0.05, 0.95), axis=0)
        inside.append((low <= true) & (true <= high))
    assert np.mean(inside) > 0.7
    assert np.max((high - low) / true) < 0.1


def test_what_lines_and_noise_leave_open_is_said():
    """A stiff mode of 30 Hz in the noise of one at 1 kHz, lines as wide as itself."""
    modes = real_modes(np.array([30.0, 1000.0]), np.array([0.02, 0.02]),
                       np.array([2e6, 2e6]) / (2 * np.pi * np.array([30.0, 1000.0])) ** 2,
                       np.eye(2))  # fmt: skip
    given = cut(spindle_rpm=(5000.0, 20000.0, 4), method="zeroth_order")
    said = {}
    for share in (0.0, 0.01):
        found = of_frf(noisy(modes, np.arange(2.0, 1300.0, 2.0), share, 5), given)
        depth = depths_of(stability_limits(found.machine(given)))
        said[share] = limit_remarks(found, given, depth, depth > 0)
    assert said[0.0] == []
    (text,) = said[0.01]
    hidden = re.search(r"Below (\S+) Hz .* would hide a mode", text)
    assert hidden is not None
    assert 30 < float(hidden[1]) < 1000


def test_spread_of_modes_explains_the_sd_that_it_makes():
    modes = two_each_way()
    spread = np.concatenate([
        [0.002, 0.004, 0.001, 0.003], [0.05, 0.02, 0.04, 0.03], [0.03, 0.02, 0.01, 0.05], [0.0],
    ])  # fmt: skip
    samples = sampled(Machine(modes, cut()), spread, (0.0, 0.0), 400, seed=1)
    h = np.array([m.modes.receptance(LINES) for m in samples]).transpose(0, 2, 3, 1)
    off = np.sqrt(np.mean(np.abs(h - h.mean(axis=0)) ** 2, axis=0))
    plane = tip(modes).in_plane(cut())
    frf = type(plane)(plane.name, LINES, plane.receptance, off)
    found, given = explaining(modes, frf)
    # Of a mode with 11 % damping 0.2 % hardly show: lines count alike, whatever their sd.
    np.testing.assert_allclose(found[:4], spread[:4], atol=7e-4)
    assert 0.9 < given < 1.1


def test_a_pole_that_hardly_swings_hides_no_uncertainty():
    """Fits bring poles with a damping ratio of almost one; unchanged they are what they were."""
    modes, heavy = two_each_way(), np.array([-0.999 + 1j * np.sqrt(1 - 0.999**2)]) * 3000.0
    modes = replace(
        modes, poles=np.append(modes.poles, heavy),
        shapes=np.vstack([modes.shapes, [[1e-4, 0]]]), drives=np.vstack([modes.drives, [[1, 0]]]),
    )  # fmt: skip
    assert moved(modes, np.zeros(16)).poles == pytest.approx(modes.poles, rel=1e-12)
    plane = tip(modes).in_plane(cut())
    frf = type(plane)(plane.name, LINES, plane.receptance, 0.05 * np.abs(plane.receptance))
    found, given = explaining(modes, frf)
    assert 0.7 < given < 1.3
    assert found[-1] > 0.02


def test_robust_depth_is_that_of_the_coefficients_alone():
    """Limits go with 1/K where both coefficients err together: the quantile is known."""
    given = cut(spindle_rpm=(9000.0, 12000.0, 3), kt_sd_percent=10.0)
    structure = Structure(one_mode(), np.array([0.0, 0.0, 0.0, 0.1]))
    exact = cut(spindle_rpm=(9000.0, 12000.0, 3))
    assert Structure(one_mode(), np.zeros(4)).samples(exact) == []  # known exactly: one limit
    found = stability_limits(structure.machine(exact))
    drawn = sampled_limits(structure.samples(exact, 60), found)
    depth = depths_of(found)
    np.testing.assert_allclose(drawn.robust(), depth * np.exp(-1.645 * 0.1), rtol=0.03)
    assert np.all(drawn.robust_sd() < 0.05)
    both = sampled_limits(structure.samples(given, 40), found)
    assert np.all(both.robust() < depth)
    assert np.all(np.mean(both.depth_m > depth * 0.5, axis=0) > 0.98)
    assert np.all(np.mean(both.depth_m > depth * 2, axis=0) < 0.1)


def test_mean_of_uncertain_frfs_is_fitted_by_modes_as_close_as_its_sd_asks():
    """The mean of many FRFs is that of no modes: many poles would follow it, and mean nothing."""
    random, lines = np.random.default_rng(3), np.arange(4.0, 80.0, 0.25)
    hertz, damping = np.array([11.7, 13.7, 35.0, 48.8, 63.2]), np.array([1, 1, 3, 5, 6.5]) / 100
    direction = random.standard_normal((5, 2))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    drawn = [
        real_modes(hertz * factor, damping, np.full(5, 40.0), direction).receptance(lines)
        for factor in 1 + 0.02 * random.standard_normal((100, 5))
    ]
    mean, sd = np.mean(drawn, axis=0), np.std(drawn, axis=0)
    frf = CutterFrf("uncertain", lines, mean.transpose(1, 2, 0), sd.transpose(1, 2, 0))
    modes = CutterFit(frf).modes
    off = np.linalg.norm(modes.receptance(lines) - mean, axis=(1, 2))
    assert np.sqrt(np.mean((off / np.linalg.norm(mean, axis=(1, 2))) ** 2)) < 0.03
    assert len(modes.poles) < 20
