"""What keeps a robot from a pose, in words: limits, links, obstacles, and what may touch."""

import re
from pathlib import Path

import numpy as np
import pytest

from planner.robot.collision import Collisions
from planner.robot.robot import Robot
from tests.support.robots import LIMITS_DEG, make_arm

FREE = np.deg2rad([0, -60, 60, 0, 20, 0])
LOW = np.deg2rad([0, 45, 40, 0, 0, 0])  # links in the floor


@pytest.fixture
def arm(tmp_path) -> Path:
    return make_arm(tmp_path)


def collisions(path: Path, more: str = "") -> Collisions:
    path.write_text(path.read_text() + more)
    return Collisions(Robot.load(path))


def box(name: str, center, size=(0.1, 0.1, 0.1), rpy=(0, 0, 0)) -> str:
    center = [float(c) for c in center]
    entries = f"center_m = {center}\nsize_m = {list(size)}\nrpy_deg = {list(rpy)}\n"
    return f'[[obstacle]]\nname = "{name}"\n{entries}'


@pytest.mark.parametrize("joint", range(6))
@pytest.mark.parametrize("side", [0, 1])
def test_every_limit_is_said(arm, joint, side):
    limit = LIMITS_DEG[joint][side]
    found = collisions(arm)
    q = FREE.copy()
    q[joint] = np.deg2rad(limit)
    assert found.limits(q) == ()  # the limit itself is allowed
    q[joint] = np.deg2rad(limit + (5 if side else -5))
    word = "above" if side else "below"
    said = f"joint_a{joint + 1} at {limit + (5 if side else -5):.1f}° is {word} its limit of"
    assert found.limits(q) == (f"{said} {limit:.1f}°",)
    assert not found.free(q)


def test_limits_come_before_contacts(arm):
    found, q = collisions(arm), LOW.copy()
    q[5] = 7.0
    assert found.violations(q) == found.limits(q) + found.contacts(q)
    assert "joint_a6" in found.violations(q)[0]
    assert "touches" in found.violations(q)[1]
    assert found.violations(FREE) == ()


def test_an_obstacle_is_called_by_its_name(arm):
    _, place = Robot.load(arm).forward(FREE)
    inside = (place[0] - 0.12, place[1], place[2] + 0.05)
    found = collisions(arm, box("vice", inside, (0.2, 0.2, 0.2)) + box("fence", (3, 3, 1)))
    contacts = found.contacts(FREE)
    assert contacts
    assert all(c.endswith("touches vice") for c in contacts)
    assert not found.free(FREE)


def test_an_obstacle_can_be_turned(arm):
    """A long beam beside the tool, that touches only once it is turned across."""
    _, place = Robot.load(arm).forward(FREE)
    beside, long = (place[0] - 0.15, place[1] + 0.45, place[2] + 0.1), (1.0, 0.1, 0.3)
    assert collisions(arm, box("beam", beside, long)).contacts(FREE) == ()
    other = make_arm(arm.parent / "turned")
    crossing = collisions(other, box("beam", beside, long, (0, 0, 90))).contacts(FREE)
    assert crossing
    assert all("beam" in c for c in crossing)


@pytest.mark.parametrize("order", [1, -1])
def test_what_is_ignored_may_touch_in_whatever_order_it_is_named(arm, order):
    pairs = [c.split(" touches ")[::order] for c in collisions(arm).contacts(LOW)]
    assert pairs
    ignored = collisions(arm, f"[collision]\nignore = {pairs}\n")
    assert ignored.contacts(LOW) == ()
    assert ignored.free(LOW)


def test_a_margin_counts_as_contact(arm):
    assert collisions(arm).free(FREE)
    wide = collisions(arm, "[collision]\nmargin_m = 0.9\n")
    assert any("floor" in c for c in wide.contacts(FREE))


def test_free_agrees_with_violations_and_only_links_apart_can_touch(arm):
    found = collisions(arm)
    robot = found.robot
    rng = np.random.default_rng(2)
    names = ["base_link", *(f"link_{i}" for i in range(1, 7))]
    touched = 0
    for q in rng.uniform(robot.lower_rad, robot.upper_rad, (150, 6)):
        contacts = found.contacts(q)
        assert found.free(q) == (contacts == ())
        touched += bool(contacts)
        for a, b in (c.split(" touches ") for c in contacts):
            assert b == "floor" or abs(names.index(a) - names.index(b)) > 1
    assert 0 < touched < 150


def test_shapes_that_overlap_in_the_middle_of_all_ranges_are_said_and_not_checked(arm):
    """A maker's coarse hull of link 3 reaches back to link 1 and far over link 5."""
    assert collisions(arm).overlapping == ()
    urdf = arm.with_name("arm.urdf")
    urdf.write_text(urdf.read_text().replace('size="0.16 0.14 0.14"', 'size="1.2 0.14 1.2"'))
    found = collisions(arm)
    unchecked = {"link_1 touches link_3", "link_3 touches link_5"}
    assert set(found.overlapping) == unchecked
    rng, robot = np.random.default_rng(0), Robot.load(arm)
    poses = rng.uniform(robot.lower_rad, robot.upper_rad, (50, 6))
    touching = set().union(*(found.contacts(q) for q in poses))
    assert not touching & unchecked
    assert {"base_link touches link_3", "link_3 touches floor"} <= touching


def without_shapes(arm: Path) -> Path:
    text = re.sub(r"<(visual|collision)>.*?</\1>", "", (arm.parent / "arm.urdf").read_text())
    (arm.parent / "arm.urdf").write_text(text)
    return arm


def test_a_robot_without_collision_shapes_or_obstacles_has_its_limits_only(arm):
    without_shapes(arm).write_text(arm.read_text().partition("[[obstacle]]")[0])
    found = collisions(arm)
    assert found.free(LOW)
    assert found.contacts(LOW) == ()
    assert not found.free(LOW + np.deg2rad(5))
    assert "Nothing is checked for collision" in (found.unchecked or "")


def test_a_line_stands_for_the_tool_that_has_no_shape(arm):
    """Links have shapes, the tool beyond the last of them has none."""
    _, tip = Robot.load(arm).forward(FREE)
    tiny = (0.02, 0.02, 0.02)
    assert collisions(arm, box("vice", tip, tiny)).contacts(FREE) == ("link_6 touches vice",)


def test_lines_stand_for_links_without_shapes_against_obstacles(arm):
    """The floor is thin: a tool below it touches nothing, but what leads there goes through it."""
    found = collisions(without_shapes(arm))
    robot = found.robot
    assert found.free(FREE)
    assert "the obstacles of robot.toml (floor)" in (found.unchecked or "")
    poses = np.random.default_rng(0).uniform(robot.lower_rad, robot.upper_rad, (200, 6))
    under = [q for q in poses if robot.forward(q)[1][2] < -0.02]
    assert len(under) > 10
    assert not any(map(found.free, under))
    _, tip = robot.forward(FREE)
    assert collisions(arm, box("vice", tip)).contacts(FREE) == ("link_6 touches vice",)
