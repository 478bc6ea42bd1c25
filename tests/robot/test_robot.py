"""Limits, mass matrix and Jacobians of a small arm."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.robot.elastic_model import ElasticModel
from planner.robot.robot import Robot
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
