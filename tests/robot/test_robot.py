"""Limits, mass matrix and Jacobians of a small arm; threads that share it; words for its axes."""

import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.proof.arms import KR10
from planner.robot.elastic_model import ElasticModel
from planner.robot.place_names import axes_in_the_room
from planner.robot.robot import Robot
from tests.support.plain_arm import make_plain_arm
from tests.support.robots import LIMITS_DEG, make_arm


@pytest.fixture(scope="module")
def arm(tmp_path_factory) -> Robot:
    return Robot.load(make_arm(tmp_path_factory.mktemp("arm"), transverse=True))


def random_poses(robot, n, seed=0):
    return np.random.default_rng(seed).uniform(robot.lower_rad, robot.upper_rad, (n, 6))


def test_limits_come_from_the_urdf(arm):
    np.testing.assert_allclose(np.rad2deg(arm.lower_rad), [low for low, _ in LIMITS_DEG])


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**31))
def test_mass_matrix_is_positive_definite(arm, seed):
    matrices = ElasticModel(arm).matrices(random_poses(arm, 1, seed))
    np.testing.assert_allclose(matrices.mass[0], matrices.mass[0].T, atol=1e-12)
    assert np.linalg.eigvalsh(matrices.mass[0])[0] > 0


def test_jacobians_are_finite_differences(arm):
    """A small elastic rotation about a joint's own axis moves the tool as the joint does."""
    q = random_poses(arm, 1)[0]
    unbent = msgspec.structs.replace(arm.config, geometric_stiffness=False)
    model, step = ElasticModel(replace(arm, config=unbent)), 1e-6
    own = next(i for i, c in enumerate(arm.config.compliance) if c.joint == "joint_a2")
    rotation, position = arm.forward(q)
    moved = q.copy()
    moved[1] += step
    difference = rotation.T @ (arm.forward(moved)[1] - position) / step
    np.testing.assert_allclose(model.matrices(q).hit[0][:, own], difference, atol=1e-5)


def test_config_is_a_value(arm):
    assert msgspec.structs.replace(arm.config) == arm.config


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
