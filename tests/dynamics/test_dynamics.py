"""Modes and FRFs against closed forms and direct solutions; gravity, frames, families."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.dynamics import vibration
from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.frf import synthesis
from planner.proof.arms import KR10
from planner.robot.robot import Robot
from tests.support.direct_solution import direct_accelerance
from tests.support.pendulums import pendulum_urdf
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


WIDE = np.linspace(5, 150, 50)
MASS, RADIUS, MOMENT, STIFFNESS = 3.0, 0.4, 0.05, 60.0

PENDULUM = pendulum_urdf(MASS, MOMENT, (0, 0, -RADIUS), (0, 0, -0.7), (0, 1, 0))


def edited(path: Path, *pairs: tuple[str, str], more: str = "") -> Path:
    text = path.read_text()
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text + "\n" + more)
    return path


def pendulum(folder: Path, **entries: object) -> Simulation:
    (folder / "one.urdf").write_text(PENDULUM)
    more = "".join(f"{key} = {value}\n" for key, value in entries.items())
    (folder / "robot.toml").write_text(
        'name = "one"\nurdf = "one.urdf"\ntcp_frame = "tip"\nsensor_frame = "tip"\n'
        "geometric_stiffness = true\n"
        '[[compliance]]\njoint = "turn"\naxis = [0, 1, 0]\n'
        f"stiffness = {STIFFNESS}\n{more}"
    )
    return Simulation(Robot.load(folder / "robot.toml"))


def test_loss_factors_against_a_direct_solution(tmp_path):
    path = edited(KR10.write(tmp_path, 2), ("damping =", "loss_factor = 0.07\ndamping ="))
    simulation, q = Simulation(Robot.load(path)), KR10.poses(2)
    m = simulation.elastic.matrices(q)
    for i in range(2):
        stiffness = simulation.stiffness + m.geometric[i]
        matrices = m.mass[i], simulation.damping, stiffness, m.hit[i], m.sensor[i]
        direct = direct_accelerance(*matrices, WIDE)
        found = simulation.accelerance(q, WIDE)[i]
        assert np.abs(found - direct).max() < 1e-9 * np.abs(direct).max()


def test_gravity_stiffens_what_hangs_and_softens_what_stands(tmp_path):
    inertia, weight = MOMENT + MASS * RADIUS**2, MASS * 9.81 * RADIUS
    simulation = pendulum(tmp_path, damping=0.1)
    for angle, sign in ((0.0, 1.0), (np.pi, -1.0)):
        frequency = simulation.modes(np.array([angle]), 1).frequency_hz[0, 0]
        expected = np.sqrt((STIFFNESS + sign * weight) / inertia) / (2 * np.pi)
        assert frequency == pytest.approx(expected, rel=1e-9)


def test_gravity_is_taken_where_the_robot_sags_to(tmp_path):
    """A pendulum held horizontal: K δ = m g r cos δ, and m g r sin δ is the stiffness there."""
    simulation = pendulum(tmp_path, damping=0.1)
    weight, sag = MASS * 9.81 * RADIUS, 0.0
    for _ in range(200):
        sag += 0.5 * (weight * np.cos(sag) / STIFFNESS - sag)
    found = simulation.elastic.matrices(np.array([np.pi / 2])).geometric[0, 0, 0]
    assert found == pytest.approx(weight * np.sin(sag), rel=2e-3)
    assert sag > 0.1  # far more than a robot would


def test_frfs_between_named_frames(tmp_path):
    simulation, q = Simulation(Robot.load(KR10.write(tmp_path, 2))), KR10.poses(2)
    frames = ("tcp", "link_3", "sensor")
    frfs = simulation.frfs(q, WIDE, hits=frames, sensors=frames)
    assert frfs.shape == (2, 3, 3, 3, 3, WIDE.size)
    swapped = np.moveaxis(frfs, (1, 2, 3, 4), (3, 4, 1, 2))
    np.testing.assert_allclose(frfs, swapped, atol=1e-9 * np.abs(frfs).max())  # Maxwell, Betti
    usual = simulation.accelerance(q, WIDE)
    np.testing.assert_allclose(frfs[:, 2, :, 0], usual, atol=1e-12 * np.abs(usual).max())
    receptance = simulation.frfs(q, WIDE, frames, frames, "receptance")
    np.testing.assert_allclose(frfs, -((2 * np.pi * WIDE) ** 2) * receptance, rtol=1e-12)
    with pytest.raises(InputError, match="elbow"):
        simulation.frfs(q, WIDE, hits=("elbow",))


def test_other_springs_leave_the_original_alone(tmp_path):
    path = edited(KR10.write(tmp_path, 2), ("gravity =", "geometric_stiffness = false\ngravity ="))
    simulation, q = Simulation(Robot.load(path)), KR10.poses(2)
    before = simulation.modes(q, 3).frequency_hz
    springs = simulation.elasticity
    softer = type(springs)(springs.stiffness / 4, springs.damping / 2, springs.loss_factor)
    np.testing.assert_allclose(simulation.changed(softer).modes(q, 3).frequency_hz, before / 2)
    np.testing.assert_array_equal(simulation.modes(q, 3).frequency_hz, before)
