"""Modes and FRFs against closed forms and a direct solution at each line."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.dynamics import vibration
from planner.dynamics.simulation import Simulation
from planner.frf import synthesis
from planner.robot.robot import Robot
from tests.support.direct_solution import direct_accelerance
from tests.support.robots import make_arm

LINES = np.linspace(2, 90, 60)


def random_system(seed: int, e: int = 6, overdamped: bool = False):
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((e, e))
    mass = a @ a.T + e * np.eye(e)
    stiffness = np.diag(rng.uniform(2e3, 3e5, e))
    damping = np.diag(rng.uniform(1, 60, e) * (100 if overdamped else 1))
    return mass[None], damping, stiffness, rng.standard_normal((2, 1, 3, e))


@pytest.mark.parametrize("overdamped", [False, True])
@pytest.mark.parametrize("proportional", [False, True])
def test_modal_sum_is_the_direct_solution(overdamped, proportional):
    mass, damping, stiffness, (hit, sensor) = random_system(1, overdamped=overdamped)
    damping = 1e-3 * stiffness if proportional else damping
    solved = vibration.solve_poles(mass, damping, stiffness, hit, sensor)
    ours = vibration.accelerance(solved, LINES)[0]
    direct = direct_accelerance(mass[0], damping, stiffness, hit[0], sensor[0], LINES)
    assert np.abs(ours - direct).max() < 1e-9 * np.abs(direct).max()


@pytest.mark.parametrize(("c", "eta"), [(25.0, 0.0), (0.0, 0.08)])
def test_one_oscillator_in_closed_form(c, eta):
    m, k = 2.5, 4.0e4
    j = np.array([[[0.3], [0.0], [-0.2]]])
    stiffness = np.array([[k * (1 + 1j * eta) if eta else k]])
    solved = vibration.solve_poles(np.array([[[m]]]), np.array([[c]]), stiffness, j, j)
    modes = vibration.oscillatory(solved, 2)
    pole = 1j * np.sqrt(k / m * (1 + 1j * eta) - (c / m / 2) ** 2) - c / m / 2
    assert modes.frequency_hz[0, 0] == pytest.approx(abs(pole) / (2 * np.pi), rel=1e-12)
    assert modes.damping_ratio[0, 0] == pytest.approx(-pole.real / abs(pole), rel=1e-10)
    assert np.isnan(modes.frequency_hz[0, 1])
    if not eta:
        omega = 2 * np.pi * LINES
        exact = -(omega**2) * 0.3**2 / (k - m * omega**2 + 1j * omega * c)
        np.testing.assert_allclose(vibration.accelerance(solved, LINES)[0, 0, 0], exact, rtol=1e-10)
    overdamped = vibration.solve_poles(np.array([[[m]]]), np.array([[2e3]]), stiffness, j, j)
    assert np.isnan(vibration.oscillatory(overdamped, 2).frequency_hz).all()


@pytest.mark.parametrize("eta", [0.0, 0.05])
@pytest.mark.parametrize("proportional", [False, True])
def test_where_gravity_is_stronger_than_a_spring_one_mode_does_not_oscillate(proportional, eta):
    mass, damping, stiffness, (hit, sensor) = random_system(2)
    damping = 1e-3 * stiffness if proportional else damping
    weight = np.linalg.eigvalsh(stiffness)[0] * 1.5 * np.eye(6)[np.argmin(np.diagonal(stiffness))]
    toppling = stiffness * (1 + 1j * eta) if eta else stiffness
    toppling = toppling - np.diag(weight)
    solved = vibration.solve_poles(mass, damping, toppling, hit, sensor)
    grows = solved.poles.real > 0.5 * np.abs(solved.poles)
    assert np.sum(grows) == 1
    assert np.sum(np.isfinite(vibration.oscillatory(solved, 6).frequency_hz)) == 5
    ours = vibration.accelerance(solved, LINES)[0]
    direct = direct_accelerance(mass[0], damping, toppling, hit[0], sensor[0], LINES)
    assert np.abs(ours - direct).max() < 1e-9 * np.abs(direct).max()


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10_000))
def test_reciprocity_at_one_point(seed):
    mass, damping, stiffness, (hit, _) = random_system(seed)
    frf = vibration.accelerance(vibration.solve_poles(mass, damping, stiffness, hit, hit), LINES)[0]
    np.testing.assert_allclose(frf, np.swapaxes(frf, 0, 1), atol=1e-9 * np.abs(frf).max())


def test_oscillatory_modes_make_the_frf():
    mass, damping, stiffness, (hit, sensor) = random_system(3)
    solved = vibration.solve_poles(mass, damping, stiffness, hit, sensor)
    modes = vibration.oscillatory(solved, 6)
    assert np.isfinite(modes.frequency_hz).all()
    assert np.all(np.diff(modes.frequency_hz[0]) >= 0)
    poles = synthesis.pole(modes.frequency_hz, modes.damping_ratio)
    sum_of_modes = synthesis.accelerance(LINES, poles, modes.residue)[0]
    whole = vibration.accelerance(solved, LINES)[0]
    np.testing.assert_allclose(sum_of_modes, whole, atol=1e-9 * np.abs(whole).max())


def test_a_batch_is_the_poses_one_by_one(tmp_path):
    simulation = Simulation(Robot.load(make_arm(tmp_path / "arm", transverse=True)))
    q = np.random.default_rng(0).uniform(-1, 1, (5, 6))
    batch = simulation.accelerance(q, LINES)
    for i in range(5):
        one = simulation.accelerance(q[i : i + 1], LINES)[0]
        np.testing.assert_allclose(batch[i], one, atol=1e-12 * np.abs(one).max())
