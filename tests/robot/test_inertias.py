"""Inertias written into a URDF are those that Pinocchio reads; halves of a link that bends."""

import re
from pathlib import Path

import msgspec
import numpy as np
import pinocchio as pin
import pytest
import tomlkit

from planner.errors import InputError
from planner.proof.arms import ARMS
from planner.robot.elastic_model import ElasticModel
from planner.robot.robot import Robot
from planner.robot.urdf_inertias import with_inertias
from planner.robot.virtual_joints import _halves, virtual_model
from tests.support.plain_arm import make_plain_arm

SPINDLE = '\n[[payload]]\nlink = "link_6"\nmass = 40.0\ncom_m = [0.02, 0.01, 0.3]\n'


def written(robot: Robot, change: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Inertias of bodies as loaded again after a change, and the bodies that have none of it."""
    made = with_inertias(robot, ElasticModel(robot).bodies, change)
    robot.urdf_path.write_text(made.urdf)
    document = tomlkit.parse(robot.path.read_text())
    for block, payload in zip(document.get("payload", ()), made.payload, strict=True):
        block.update(msgspec.to_builtins(payload))
    robot.path.write_text(tomlkit.dumps(document))
    return ElasticModel(Robot.load(robot.path)).inertia, made.unchanged


@pytest.mark.parametrize("name", list(ARMS))
@pytest.mark.parametrize("base", [False, True])
def test_a_change_is_written_whole(tmp_path: Path, name, base):
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
    after, unchanged = written(robot, change)
    assert unchanged == ()
    np.testing.assert_allclose(after, elastic.inertia + change, rtol=1e-6, atol=1e-7)
    size = np.abs(change).max()
    assert np.abs(after - elastic.inertia).max() == pytest.approx(size, rel=1e-3)


def test_a_spindle_takes_the_change_that_the_flange_could_not(tmp_path: Path):
    path = ARMS["kr210"].write(tmp_path)
    path.write_text(path.read_text() + SPINDLE)
    robot = Robot.load(path)
    inertia = ElasticModel(robot).inertia
    change = np.zeros_like(inertia)
    change[-1] = -0.3 * inertia[-1]  # more than the flange weighs
    after, unchanged = written(robot, change)
    assert unchanged == ()
    np.testing.assert_allclose(after, inertia + change, rtol=1e-6, atol=1e-7)
    [spindle] = Robot.load(path).config.payload
    assert spindle.mass == pytest.approx(0.7 * 40.0)
    np.testing.assert_allclose(spindle.com_m, [0.02, 0.01, 0.3], rtol=1e-6)


def test_what_matter_cannot_form_is_left_as_it_was(tmp_path: Path):
    robot = Robot.load(ARMS["kr210"].write(tmp_path))
    elastic = ElasticModel(robot)
    change = np.zeros_like(elastic.inertia)
    change[1, 0] = -2 * elastic.inertia[1, 0]
    after, unchanged = written(robot, change)
    assert unchanged == (elastic.bodies[1],)
    np.testing.assert_allclose(after, elastic.inertia, rtol=1e-6, atol=1e-7)


def test_comments_of_the_urdf_stay(tmp_path: Path):
    path = ARMS["kr10"].write(tmp_path)
    urdf = path.with_name("robot.urdf")
    head = '<?xml version="1.0"?>\n<!-- measured in spring -->\n'
    urdf.write_text(head + urdf.read_text().replace("<joint", "<!-- a joint --><joint", 1))
    robot = Robot.load(path)
    elastic = ElasticModel(robot)
    text = with_inertias(robot, elastic.bodies, 0.001 * elastic.inertia).urdf
    assert text.startswith(head)
    assert "<!-- a joint -->" in text


@pytest.mark.parametrize("times", [1, 200])
def test_a_body_of_less_than_no_inertia_is_refused_in_a_sentence(tmp_path, times):
    robot = Robot.load(make_plain_arm(tmp_path))
    change = np.zeros_like(ElasticModel(robot).inertia)
    change[-1] = -times * ElasticModel(robot).inertia[-1]
    with pytest.raises(InputError, match="moves no inertia of its own"):
        ElasticModel(robot, change)


LENGTH, WIDTH, HEIGHT, MASS = 1.2, 0.5, 0.3, 90.0


def halves(tmp_path, urdf=lambda text: text):
    """Inner and outer half (10,) each of link_2, and where it is cut (3,)."""
    path = ARMS["kr210"].write(tmp_path)
    robot = Robot.load(path)
    robot.urdf_path.write_text(urdf(robot.urdf_path.read_text()))
    path.write_text(
        path.read_text() + '\n[[effects]]\neffect = "x"\nat = ""\n[[effects.compliance]]\n'
        'joint = "link_2"\naxis = [0, 0, 1]\nstiffness = 4.0e6\ndamping = 2.0e3\n'
    )
    robot = Robot.load(path)
    model = virtual_model(robot)
    by_name = dict(zip(model.bodies, model.inertia, strict=True))
    cut = robot.model.jointPlacements[3].translation / 2
    return by_name["joint_2"], by_name["link_2, outer half"], cut


def block(text: str) -> str:
    """link_2 as a uniform block."""
    xx = MASS * (WIDTH**2 + HEIGHT**2) / 12
    yy = MASS * (LENGTH**2 + HEIGHT**2) / 12
    zz = MASS * (LENGTH**2 + WIDTH**2) / 12
    inertial = (
        f'<inertial><origin xyz="0.5 0.1 0" rpy="0 0 0"/><mass value="{MASS}"/>'
        f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    return re.sub(r'(<link name="link_2">)<inertial>.*?</inertial>', rf"\1{inertial}", text)


def test_halves_of_a_block_are_blocks(tmp_path):
    inner, outer, cut = halves(tmp_path, block)
    own = [WIDTH**2 + HEIGHT**2, LENGTH**2 / 4 + HEIGHT**2, LENGTH**2 / 4 + WIDTH**2]
    for half, centre in (
        (inner, np.array([0.5 - LENGTH / 4, 0.1, 0])),
        (outer, np.array([0.5 + LENGTH / 4, 0.1, 0]) - cut),
    ):
        assert half[0] == pytest.approx(MASS / 2)
        np.testing.assert_allclose(half[1:4] / half[0], centre, atol=1e-12)
        moved = MASS / 2 * (centre @ centre - centre**2)
        about = np.array([half[4], half[6], half[9]]) - moved
        np.testing.assert_allclose(about, MASS / 2 * np.array(own) / 12, rtol=1e-9)


def test_halves_together_are_the_link_whichever_way_it_leans(tmp_path):
    inner, outer, cut = halves(tmp_path)
    (tmp_path / "whole").mkdir()
    whole = virtual_model(Robot.load(ARMS["kr210"].write(tmp_path / "whole"))).inertia[1]
    assert inner[0] == pytest.approx(outer[0])
    np.testing.assert_allclose(inner[1:4] + outer[1:4] + outer[0] * cut, whole[1:4], rtol=1e-9)
    both = inner[4:] + outer[4:]  # about different points: Steiner
    steiner = np.outer(cut, outer[1:4])
    moved = 2 * np.trace(steiner) * np.eye(3) - steiner - steiner.T
    moved += outer[0] * (cut @ cut * np.eye(3) - np.outer(cut, cut))
    order = [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)]
    np.testing.assert_allclose(both + [moved[ij] for ij in order], whole[4:], rtol=1e-9, atol=1e-9)


def test_a_body_whose_halves_would_have_no_moments_is_refused():
    body = pin.Inertia(1.0, np.zeros(3), np.diag([1e-3, 1e-3, 1e-3])).toDynamicParameters()
    with pytest.raises(InputError, match="moments of inertia"):
        _halves(np.array(body), np.array([0.5, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]))
