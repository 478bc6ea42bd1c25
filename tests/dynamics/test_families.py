"""Structural damping, gravity and named frames, against closed forms and direct solutions."""

from pathlib import Path

import numpy as np
import pytest

from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.proof.arms import KR10
from planner.robot.robot import Robot
from tests.support.direct_solution import direct_accelerance
from tests.support.pendulums import pendulum_urdf

LINES = np.linspace(5, 150, 50)
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
        direct = direct_accelerance(*matrices, LINES)
        found = simulation.accelerance(q, LINES)[i]
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
    frfs = simulation.frfs(q, LINES, hits=frames, sensors=frames)
    assert frfs.shape == (2, 3, 3, 3, 3, LINES.size)
    swapped = np.moveaxis(frfs, (1, 2, 3, 4), (3, 4, 1, 2))
    np.testing.assert_allclose(frfs, swapped, atol=1e-9 * np.abs(frfs).max())  # Maxwell, Betti
    usual = simulation.accelerance(q, LINES)
    np.testing.assert_allclose(frfs[:, 2, :, 0], usual, atol=1e-12 * np.abs(usual).max())
    receptance = simulation.frfs(q, LINES, frames, frames, "receptance")
    np.testing.assert_allclose(frfs, -((2 * np.pi * LINES) ** 2) * receptance, rtol=1e-12)
    with pytest.raises(InputError, match="elbow"):
        simulation.frfs(q, LINES, hits=("elbow",))


def test_other_springs_leave_the_original_alone(tmp_path):
    path = edited(KR10.write(tmp_path, 2), ("gravity =", "geometric_stiffness = false\ngravity ="))
    simulation, q = Simulation(Robot.load(path)), KR10.poses(2)
    before = simulation.modes(q, 3).frequency_hz
    springs = simulation.elasticity
    softer = type(springs)(springs.stiffness / 4, springs.damping / 2, springs.loss_factor)
    np.testing.assert_allclose(simulation.changed(softer).modes(q, 3).frequency_hz, before / 2)
    np.testing.assert_array_equal(simulation.modes(q, 3).frequency_hz, before)
