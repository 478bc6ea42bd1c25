"""One tool taken off and another put on, against an assembly by finite elements.

It is a rod on a spring-mounted, cross-coupled machine, assembled by finite elements of low order.
Independent of the planner's transfer matrices: two-node Timoshenko elements (Przemieniecki,
Theory of Matrix Structural Analysis, 1968) with lumped-free consistent masses, many of them, put
together with the machine's matrices and solved line by line. A node has (x, θy, y, θx).
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.signal import find_peaks

from planner.milling.beam import Segment, ToolContact, ToolMaterial
from planner.milling.coupling import TipReceptance, couple
from planner.milling.cutter_frf import CutterFrf
from planner.milling.tip_files import two_point_receptance
from planner.milling.tool import Point, Tool

E, RHO, NU, LOSS = 5.4e11, 14500.0, 0.25, 0.001
SHEAR = 6 * (1 + NU) / (7 + 6 * NU)


@dataclass(frozen=True)
class Machine:
    """What holds the tool: M, C, K (n, n) whose first four coordinates are the tool's seat."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray


def machine(split: float = 1.15, cross: float = 0.3, seed: int = 0) -> Machine:
    """Two sets of four coupled coordinates: modes of some 12 Hz to 1 kHz.

    `split` is the ratio of frequencies of the x and the y plane, `cross` how strongly they couple.
    """
    rng = np.random.default_rng(seed)
    seat = np.diag([6.0, 0.02, 6.0, 0.02])
    body = np.diag([120.0, 8.0, 120.0, 8.0])
    mass = np.block([[seat, np.zeros((4, 4))], [np.zeros((4, 4)), body]])
    turn = np.eye(4) + cross * np.triu(rng.uniform(-1, 1, (4, 4)), 1) * np.array(
        [[1, 0.05, 1, 0.05], [20, 1, 20, 1], [1, 0.05, 1, 0.05], [20, 1, 20, 1]]
    )
    held = turn.T @ np.diag([2e8, 6e5, 2e8 * split**2, 6e5 * split**2]) @ turn
    ground = np.diag([1.2e6, 2.0e5, 1.2e6 * split**2, 2.0e5 * split**2])
    stiffness = np.block([[held, -held], [-held, held + ground]])
    return Machine(mass, 2e-5 * stiffness + 2.0 * mass, stiffness)


def frf(
    base: Machine, pieces: list[tuple[float, float, int]], frequency_hz: np.ndarray,
    contact: tuple[float, float, float, float] | None = None, points: tuple[int, ...] = (-1,),
) -> np.ndarray:  # fmt: skip
    """Receptances (F, 4p, 4p) at nodes of a rod, numbered from its seat, of the whole assembly.

    `pieces` are (length, diameter, elements) from the seat; `contact` stiffness and damping across
    and turning, rigid where None.
    """
    nodes = 1 + sum(n for _, _, n in pieces)
    m, k = np.zeros((2, 4 * nodes, 4 * nodes))
    at = 0
    for length, diameter, n in pieces:
        for _ in range(n):
            for plane, sign in ((0, 1.0), (2, -1.0)):
                stiff, inert = _element(length / n, diameter)
                flip = np.array([1, sign, 1, sign])
                i = 4 * at + plane + np.array([0, 1, 4, 5])
                k[np.ix_(i, i)] += stiff * np.outer(flip, flip)
                m[np.ix_(i, i)] += inert * np.outer(flip, flip)
            at += 1
    size = len(base.mass)
    out = []
    rows = np.concatenate([4 * (p % nodes) + np.arange(4) for p in points])
    for f in frequency_hz:
        w = 2 * np.pi * f
        rod = k * (1 + 1j * LOSS) - w**2 * m
        held = base.stiffness + 1j * w * base.damping - w**2 * base.mass
        if contact is None:  # the rod's first node is the seat
            z = np.zeros((size + 4 * (nodes - 1),) * 2, complex)
            place = np.concatenate([np.arange(4), size + np.arange(4 * (nodes - 1))])
        else:
            z = np.zeros((size + 4 * nodes,) * 2, complex)
            place = size + np.arange(4 * nodes)
        z[:size, :size] += held
        z[np.ix_(place, place)] += rod
        if contact is not None:
            kt, kr, ct, cr = contact
            spring = np.diag(np.tile([kt + 1j * w * ct, kr + 1j * w * cr], 2))
            seat = size + np.arange(4)
            z[:4, :4] += spring
            z[np.ix_(seat, seat)] += spring
            z[:4, seat] -= spring
            z[seat, :4] -= spring
        unit = np.zeros((len(z), len(rows)), complex)
        unit[place[rows], range(len(rows))] = 1
        out.append(np.linalg.solve(z, unit)[place[rows]])
    return np.array(out)


def _element(length: float, diameter: float) -> tuple[np.ndarray, np.ndarray]:
    area, second = np.pi / 4 * diameter**2, np.pi / 64 * diameter**4
    phi = 12 * E * second / (SHEAR * E / (2 * (1 + NU)) * area * length**2)
    a, n = length, 1 + phi
    k = E * second / (a**3 * n) * np.array([
        [12, 6 * a, -12, 6 * a], [6 * a, (4 + phi) * a**2, -6 * a, (2 - phi) * a**2],
        [-12, -6 * a, 12, -6 * a], [6 * a, (2 - phi) * a**2, -6 * a, (4 + phi) * a**2],
    ])  # fmt: skip
    return k, RHO * (area * _translation(a, phi) + second * _rotation(a, phi))


def _translation(a: float, phi: float) -> np.ndarray:
    m1 = 13 / 35 + 7 * phi / 10 + phi**2 / 3
    m2 = (11 / 210 + 11 * phi / 120 + phi**2 / 24) * a
    m3 = 9 / 70 + 3 * phi / 10 + phi**2 / 6
    m4 = -(13 / 420 + 3 * phi / 40 + phi**2 / 24) * a
    m5 = (1 / 105 + phi / 60 + phi**2 / 120) * a**2
    m6 = -(1 / 140 + phi / 60 + phi**2 / 120) * a**2
    rows = [[m1, m2, m3, m4], [m2, m5, -m4, m6], [m3, -m4, m1, -m2], [m4, m6, -m2, m5]]
    return a / (1 + phi) ** 2 * np.array(rows)


def _rotation(a: float, phi: float) -> np.ndarray:
    m7, m8 = 6 / 5, (1 / 10 - phi / 2) * a
    m9 = (2 / 15 + phi / 6 + phi**2 / 3) * a**2
    m10 = (-1 / 30 - phi / 6 + phi**2 / 6) * a**2
    rows = [[m7, m8, -m7, m8], [m8, m9, -m8, m10], [-m7, -m8, m7, -m8], [m8, m10, -m8, m9]]
    return 1 / (a * (1 + phi) ** 2) * np.array(rows)


FREQUENCY = np.concatenate([np.arange(5.0, 60.0, 0.5), np.arange(60.0, 1600.0, 8.0)])
CARBIDE = ToolMaterial(E, RHO, NU, LOSS)
RIGID_ENOUGH = (6.25e7, 3.86e6, 175.0, 0.14)
LOOSER = (4.5e7, 4.19e6, 210.0, 1.5)
REFERENCE = [(0.030, 0.02, 12), (0.020, 0.02, 8)]
TARGET = [(0.045, 0.018, 18)]
PLACES = [0, 2, 3, 1]  # (x, θy, y, θx) as (x, y, θx, θy)
ACROSS = (0, 1)  # directions in which both points are measured
KEPT = np.ix_([0, 1, 3, 4], [0, 1, 3, 4])


def tool(pieces, contact=None):
    parts = [Segment(length, d, d, CARBIDE) for length, d, _ in pieces]
    if contact is not None:
        parts[0] = replace(parts[0], contact=ToolContact(*contact))
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


TESTED, PUT_ON = tool(REFERENCE, RIGID_ENOUGH), tool(TARGET, LOOSER)


def tip_of(values, noise=0.0, seed=0):
    """Receptances at the tested tool's tip, of its tip and a point 20 mm behind it."""
    return two_point_receptance(measured(values, noise, seed), ACROSS, TESTED, Point("1a", 0.02))


@pytest.fixture(scope="module")
def assembled():
    base = machine()
    reference = frf(base, REFERENCE, FREQUENCY, RIGID_ENOUGH, points=(-1, 12))
    return reference, ordered(frf(base, TARGET, FREQUENCY, LOOSER))


def test_two_points_tell_the_rotations_of_a_bending_tool(assembled):
    reference, target = assembled
    found = couple(tip_of(reference), PUT_ON, TESTED)
    size = np.sqrt(np.einsum("iif,jjf->ijf", np.abs(target), np.abs(target)))
    assert np.max(np.abs(found.receptance[KEPT] - target) / size) < 1e-5


def test_one_percent_noise_and_what_the_sd_says_of_it(assembled):
    reference, target = assembled
    found = couple(tip_of(reference, 0.01, 3), PUT_ON, TESTED)
    error = np.abs(found.receptance[KEPT] - target)
    assert np.sqrt(np.mean((error / found.sd[KEPT]) ** 2)) == pytest.approx(1.0, abs=0.08)
    for k in range(2):
        peaks = find_peaks(np.abs(target[k, k]))[0]
        assert np.max(error[k, k, peaks] / np.abs(target[k, k, peaks])) < 0.05


def test_amplification_is_the_growth_of_errors(assembled):
    reference, _ = assembled
    exact = couple(tip_of(reference), PUT_ON, TESTED)
    grown = np.zeros(len(FREQUENCY))
    for seed in range(25):
        found = couple(tip_of(reference, 1e-5, seed), PUT_ON, TESTED)
        off = (found.receptance - exact.receptance)[:2, :2]
        grown += np.sum(np.abs(off) ** 2, axis=(0, 1)) / 25
    size = np.sum(np.abs(exact.receptance[:2, :2]) ** 2, axis=(0, 1))
    ratio = np.sqrt(grown / size) / 1e-5 / exact.amplification
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.03)
    assert np.max(np.abs(ratio - 1)) < 0.7


@pytest.mark.parametrize("axis", [(0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.6, 0.0, 0.8)])
def test_a_tool_along_any_axis(axis):
    """Turning robot and tool together turns the answer."""
    rng = np.random.default_rng(1)
    half = rng.standard_normal((6, 6, 4)) * np.repeat([1e-7, 1e-6], 3)[:, None, None]
    c, f = half + np.swapaxes(half, 0, 1), np.linspace(10, 900, 4)
    other = Tool("t", axis, PUT_ON.parts)
    turn = np.kron(np.eye(2), other.frame)
    expected = couple(TipReceptance.known(f, c), PUT_ON).receptance
    turned = np.einsum("ij,jkf,lk->ilf", turn, c, turn)
    found = couple(TipReceptance.known(f, turned), other).receptance
    assert found == pytest.approx(np.einsum("ij,jkf,lk->ilf", turn, expected, turn), rel=1e-7)


def test_an_uncertain_contact_widens_the_answer(assembled):
    reference, _ = assembled
    tip, contact = tip_of(reference), ToolContact(*LOOSER, sd_percent=20.0)
    softer = contact.scaled("stiffness_n_m", 1.2)
    known, sure, moved = (
        couple(tip, held, TESTED)
        for held in (PUT_ON, PUT_ON.held(0, contact), PUT_ON.held(0, softer))
    )
    assert np.nanmax(known.sd) == 0
    off = np.abs(moved.receptance - known.receptance)[0, 0]
    assert np.all(sure.sd[0, 0] >= off * (1 - 1e-9))
