"""One tool taken off and another put on, against an assembly by finite elements."""

import numpy as np
import pytest
from scipy.signal import find_peaks

from planner.milling.beam import Segment, ToolMaterial
from planner.milling.coupling import TipReceptance, couple
from planner.milling.cutter_frf import CutterFrf
from planner.milling.tip_files import two_point_receptance
from planner.milling.tool import Point, Tool, ToolContact, ToolPart
from tests.milling.assembled import LOSS, NU, RHO, E, frf, machine

FREQUENCY = np.concatenate([np.arange(5.0, 60.0, 0.25), np.arange(60.0, 1600.0, 5.0)])
CARBIDE = ToolMaterial(E, RHO, NU, LOSS)
RIGID_ENOUGH = (6.25e7, 3.86e6, 175.0, 0.14)
LOOSER = (4.5e7, 4.19e6, 210.0, 1.5)
REFERENCE = [(0.030, 0.02, 12), (0.020, 0.02, 8)]
TARGET = [(0.045, 0.018, 18)]
PLACES = [0, 2, 3, 1]  # (x, θy, y, θx) as (x, y, θx, θy)
ACROSS = (0, 1)  # directions in which both points are measured
KEPT = np.ix_([0, 1, 3, 4], [0, 1, 3, 4])


def tool(pieces, contact=None):
    parts = [ToolPart(Segment(length, d, d, CARBIDE)) for length, d, _ in pieces]
    if contact is not None:
        parts[0] = ToolPart(parts[0].segment, ToolContact(*contact))
    return Tool("a rod", (0.0, 0.0, 1.0), tuple(parts))


def ordered(values):
    """(F, 4, 4) of a node as (4, 4, F) over x, y, θx, θy."""
    return np.moveaxis(values[:, PLACES][:, :, PLACES], 0, -1)


def measured(values, noise=0.0, seed=0):
    """Two points' motions (F, 8, 8) with relative noise."""
    moved = np.moveaxis(values[:, ::2][:, :, ::2], 0, -1)
    a, b = np.random.default_rng(seed).standard_normal((2, *moved.shape))
    sd = noise * np.abs(moved)
    return CutterFrf("two points", FREQUENCY, moved + sd * (a + 1j * b) / np.sqrt(2), sd)


@pytest.fixture(scope="module")
def assembled():
    base = machine()
    reference = frf(base, REFERENCE, FREQUENCY, RIGID_ENOUGH, points=(-1, 12))
    return reference, ordered(frf(base, TARGET, FREQUENCY, LOOSER))


def test_two_points_tell_the_rotations_of_a_bending_tool(assembled):
    reference, target = assembled
    ref = tool(REFERENCE, RIGID_ENOUGH)
    tip = two_point_receptance(measured(reference), ACROSS, ref, Point("1a", 0.02))
    found = couple(tip, tool(TARGET, LOOSER), ref)
    size = np.sqrt(np.einsum("iif,jjf->ijf", np.abs(target), np.abs(target)))
    assert np.max(np.abs(found.receptance[KEPT] - target) / size) < 1e-5


def test_one_percent_noise_and_what_the_sd_says_of_it(assembled):
    reference, target = assembled
    ref = tool(REFERENCE, RIGID_ENOUGH)
    tip = two_point_receptance(measured(reference, 0.01, 3), ACROSS, ref, Point("1a", 0.02))
    found = couple(tip, tool(TARGET, LOOSER), ref)
    error = np.abs(found.receptance[KEPT] - target)
    assert np.sqrt(np.mean((error / found.sd[KEPT]) ** 2)) == pytest.approx(1.0, abs=0.08)
    for k in range(2):
        peaks = find_peaks(np.abs(target[k, k]))[0]
        assert np.max(error[k, k, peaks] / np.abs(target[k, k, peaks])) < 0.05


def test_amplification_is_the_growth_of_errors(assembled):
    reference, _ = assembled
    ref, put = tool(REFERENCE, RIGID_ENOUGH), tool(TARGET, LOOSER)
    exact = couple(
        two_point_receptance(measured(reference), ACROSS, ref, Point("1a", 0.02)), put, ref
    )
    grown = np.zeros(len(FREQUENCY))
    for seed in range(25):
        tip = two_point_receptance(measured(reference, 1e-5, seed), ACROSS, ref, Point("1a", 0.02))
        off = (couple(tip, put, ref).receptance - exact.receptance)[:2, :2]
        grown += np.sum(np.abs(off) ** 2, axis=(0, 1)) / 25
    size = np.sum(np.abs(exact.receptance[:2, :2]) ** 2, axis=(0, 1))
    ratio = np.sqrt(grown / size) / 1e-5 / exact.amplification
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.03)
    assert np.max(np.abs(ratio - 1)) < 0.7


def test_taking_off_undoes_putting_on():
    rng = np.random.default_rng(0)
    half = rng.standard_normal((6, 6, 5)) * 1e-7
    holder = TipReceptance.known(np.linspace(10, 900, 5), half + np.swapaxes(half, 0, 1))
    on = couple(holder, tool(TARGET, LOOSER))
    back = couple(TipReceptance.known(on.frequency_hz, on.receptance), None, tool(TARGET, LOOSER))
    assert back.receptance == pytest.approx(np.moveaxis(holder.receptance, 0, -1), rel=1e-8)


@pytest.mark.parametrize("axis", [(0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.6, 0.0, 0.8)])
def test_a_tool_along_any_axis(axis):
    """Turning robot and tool together turns the answer."""
    rng = np.random.default_rng(1)
    half = rng.standard_normal((6, 6, 4)) * np.repeat([1e-7, 1e-6], 3)[:, None, None]
    c, f = half + np.swapaxes(half, 0, 1), np.linspace(10, 900, 4)
    straight, other = tool(TARGET, LOOSER), Tool("t", axis, tool(TARGET, LOOSER).parts)
    turn = np.kron(np.eye(2), other.frame)
    expected = couple(TipReceptance.known(f, c), straight).receptance
    turned = np.einsum("ij,jkf,lk->ilf", turn, c, turn)
    found = couple(TipReceptance.known(f, turned), other).receptance
    assert found == pytest.approx(np.einsum("ij,jkf,lk->ilf", turn, expected, turn), rel=1e-7)


def test_an_uncertain_contact_widens_the_answer(assembled):
    reference, _ = assembled
    ref, put = tool(REFERENCE, RIGID_ENOUGH), tool(TARGET, LOOSER)
    tip = two_point_receptance(measured(reference), ACROSS, ref, Point("1a", 0.02))
    contact = ToolContact(*LOOSER, sd_percent=20.0)
    sd = couple(tip, put.held(0, contact), ref).sd[0, 0]
    moved = couple(tip, put.held(0, contact.scaled("stiffness_n_m", 1.2)), ref).receptance[0, 0]
    assert np.nanmax(couple(tip, put, ref).sd) == 0
    assert np.all(sd >= np.abs(moved - couple(tip, put, ref).receptance[0, 0]) * (1 - 1e-9))
