"""Inertias written into a URDF: what Pinocchio reads from it is what was asked for."""

from pathlib import Path

import numpy as np
import pytest

from planner.errors import InputError
from planner.proof.arms import ARMS
from planner.robot.elastic_model import ElasticModel
from planner.robot.robot import Robot
from planner.robot.urdf_inertias import urdf_with_inertias
from tests.support.plain_arm import make_plain_arm


@pytest.mark.parametrize("name", list(ARMS))
@pytest.mark.parametrize("base", [False, True])
def test_a_small_change_is_taken_whole(tmp_path: Path, name, base):
    path = ARMS[name].write(tmp_path)
    if base:
        text = path.read_text()
        block = '[[compliance]]\njoint = "base"\naxis = [1, 0, 0]\nstiffness = 1e7\ndamping = 1e4\n'
        path.write_text(text.replace("[[compliance]]", block + "\n[[compliance]]", 1))
    robot = Robot.load(path)
    elastic = ElasticModel(robot)
    rng = np.random.default_rng(0)
    change = 0.004 * elastic.inertia * rng.standard_normal((len(elastic.bodies), 1))
    change[:, 0] *= 1.2
    text, shares = urdf_with_inertias(robot, elastic.bodies, change)
    assert shares == {}
    robot.urdf_path.write_text(text)
    after = ElasticModel(Robot.load(path)).inertia
    np.testing.assert_allclose(after, elastic.inertia + change, rtol=1e-6, atol=1e-7)
    size = np.abs(change).max()
    assert np.abs(after - elastic.inertia).max() == pytest.approx(size, rel=1e-3)


def test_what_matter_cannot_form_is_taken_in_part(tmp_path: Path):
    robot = Robot.load(ARMS["kr210"].write(tmp_path))
    elastic = ElasticModel(robot)
    change = np.zeros_like(elastic.inertia)
    change[1, 0] = -2 * elastic.inertia[1, 0]
    text, shares = urdf_with_inertias(robot, elastic.bodies, change)
    body = elastic.bodies[1]
    assert list(shares) == [body]
    assert 0 < shares[body] < 0.5
    robot.urdf_path.write_text(text)
    after = ElasticModel(Robot.load(robot.path)).inertia
    np.testing.assert_allclose(after, elastic.inertia + shares[body] * change, rtol=1e-6, atol=1e-7)


def test_comments_of_the_urdf_stay(tmp_path: Path):
    path = ARMS["kr10"].write(tmp_path)
    urdf = path.with_name("robot.urdf")
    head = '<?xml version="1.0"?>\n<!-- measured in spring -->\n'
    urdf.write_text(head + urdf.read_text().replace("<joint", "<!-- a joint --><joint", 1))
    robot = Robot.load(path)
    elastic = ElasticModel(robot)
    text, _ = urdf_with_inertias(robot, elastic.bodies, 0.001 * elastic.inertia)
    assert text.startswith(head)
    assert "<!-- a joint -->" in text


@pytest.mark.parametrize("times", [1, 2, 5, 200])
def test_a_body_of_less_than_no_inertia_is_refused_in_a_sentence(tmp_path, times):
    robot = Robot.load(make_plain_arm(tmp_path))
    change = np.zeros_like(ElasticModel(robot).inertia)
    change[-1] = -times * ElasticModel(robot).inertia[-1]
    with pytest.raises(InputError, match="moves no inertia of its own"):
        ElasticModel(robot, change)
