"""Which way the tool's axes point, told to who stands in the cell."""

import numpy as np
import pytest

from planner.robot.robot import Robot
from planner.robot.room_directions import axes_in_the_room
from tests.support.plain_arm import make_plain_arm


class _Placed:
    """A robot whose tool is where and as it is said; only what the words need."""

    def __init__(self, robot: Robot, rotation, place):
        self.config, self.joints, self.joint_places = robot.config, robot.joints, robot.joint_places
        self.forward = lambda q: (np.array(rotation, dtype=float).T, np.array(place, dtype=float))


@pytest.mark.parametrize(
    ("place", "axes", "said"),
    [
        ((2, 0, 1), ((1, 0, 0), (0, 1, 0), (0, 0, 1)), ("away from the base", "left", "up")),
        ((0, 2, 1), ((1, 0, 0), (0, 1, 0), (0, 0, 1)), ("right", "away from the base", "up")),
        ((2, 0, 1), ((-0.7, 0, -0.7), (0, 1, 0), (0.7, 0, -0.7)),
         ("down and towards the base", "left", "down and away from the base")),
        ((0, 0, 2), ((1, 0, 0), (0, -1, 0), (0, 0, -1)), ("away from the base", "right", "down")),
    ],
)  # fmt: skip
def test_axes_are_told_as_seen_from_the_base(tmp_path, place, axes, said):
    robot = Robot.load(make_plain_arm(tmp_path))
    placed = _Placed(robot, axes, place)
    assert axes_in_the_room(placed, np.zeros(len(robot.joint_names))) == said  # pyright: ignore
