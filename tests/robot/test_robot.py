"""Threads that share an elastic model; words for the axes of a tool."""

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from planner.proof.arms import KR10
from planner.robot.elastic_model import ElasticModel
from planner.robot.place_names import axes_in_the_room
from planner.robot.robot import Robot
from tests.support.plain_arm import make_plain_arm


@pytest.fixture
def often():
    """Threads take turns as often as they can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.parametrize("gravity", [False, True])
def test_threads_may_share_an_elastic_model(tmp_path, often, gravity):
    path = KR10.write(tmp_path, 2)
    if not gravity:
        path.write_text("geometric_stiffness = false\n" + path.read_text())
    model = ElasticModel(Robot.load(path))
    poses = [KR10.poses(3, seed) for seed in range(200)]

    def matrices(q: np.ndarray) -> tuple[np.ndarray, ...]:
        found = model.matrices(q)
        return found.mass, found.hit, found.sensor, found.geometric, model.body_jacobians(q)

    with ThreadPoolExecutor(2) as pool:
        shared = list(pool.map(matrices, poses))
    for alone, there in zip(map(matrices, poses), shared, strict=True):
        for one, other in zip(alone, there, strict=True):
            assert np.array_equal(one, other)


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
    assert axes_in_the_room(placed, np.zeros(len(robot.joint_names))) == said
