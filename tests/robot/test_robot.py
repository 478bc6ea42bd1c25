"""Limits, contacts, inverse kinematics and workspaces of a small arm."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.campaign.config import WorkspaceTable
from planner.errors import InputError, NoPoseLeftError
from planner.robot.collision import Collisions
from planner.robot.elastic_model import ElasticModel
from planner.robot.inverse_kinematics import solve
from planner.robot.robot import Robot
from planner.robot.workspace import Workspace
from tests.support.robots import JOINTS_DEG, LIMITS_DEG, make_arm


@pytest.fixture(scope="module")
def arm(tmp_path_factory) -> Robot:
    return Robot.load(make_arm(tmp_path_factory.mktemp("arm"), transverse=True))


def random_poses(robot, n, seed=0):
    return np.random.default_rng(seed).uniform(robot.lower_rad, robot.upper_rad, (n, 6))


def test_limits_come_from_the_urdf_and_are_said(arm):
    np.testing.assert_allclose(np.rad2deg(arm.lower_rad), [low for low, _ in LIMITS_DEG])
    q = np.deg2rad([0, -90, 160, 0, 0, 0])
    assert Collisions(arm).limits(q) == ("joint_a3 at 160.0° is above its limit of 156.0°",)


def test_contact_with_the_floor_is_said(arm):
    q = np.deg2rad([0, 45, 40, 0, 0, 0])
    contacts = Collisions(arm).contacts(q)
    assert any(text.endswith("touches floor") for text in contacts)
    assert not Collisions(arm).free(q)


def test_inverse_kinematics_finds_at_least_95_percent_of_reachable_targets(arm):
    found = 0
    poses = random_poses(arm, 150)
    for i, q in enumerate(poses):
        rotation, position = arm.forward(q)
        result = solve(arm, rotation, position, seed=i)
        if result.q is None:
            continue
        again = arm.forward(result.q)
        np.testing.assert_allclose(again[0], rotation, atol=1e-5)
        np.testing.assert_allclose(again[1], position, atol=1e-5)
        assert np.all(result.q >= arm.lower_rad)
        assert np.all(result.q <= arm.upper_rad)
        found += 1
    print(f"{found} of {len(poses)} targets found")
    assert found >= 0.95 * len(poses)


def test_unreachable_targets_are_explained(arm):
    far = solve(arm, np.eye(3), np.array([3.0, 0, 0.5]), restarts=3)
    assert far.q is None
    assert "out of reach" in far.reason
    q = np.deg2rad([0, -60, 60, 0, 20, 0])
    rotation, position = arm.forward(q)
    narrow = robot_with_limits(arm, 2, -0.2, 0.2)
    blocked = solve(narrow, rotation, position, start=q.clip(-0.2, 0.2), restarts=3)
    assert blocked.q is None
    assert "joint_a3" in blocked.reason or "limit" in blocked.reason
    low = np.deg2rad([0, 45, 40, 0, 0, 0])
    rotation, position = arm.forward(low)
    touching = solve(arm, rotation, position, low, Collisions(arm), restarts=0)
    assert touching.q is None
    assert touching.reason in Collisions(arm).contacts(low)


def robot_with_limits(robot, joint, low, high):
    model = robot.model.copy()
    lower, upper = robot.lower_rad.copy(), robot.upper_rad.copy()
    lower[joint], upper[joint] = low, high
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    return replace(robot, model=model)


def test_joint_box(arm):
    workspace = Workspace.from_table(WorkspaceTable(joints_deg=list(JOINTS_DEG)), arm)
    found = workspace.candidates(arm, 64, 0)
    assert len(found.q) == 64
    assert np.all((found.features >= 0) & (found.features <= 1))
    assert workspace.contains(arm, found.q).all()
    collisions = Collisions(arm)
    assert all(collisions.free(q) for q in found.q)
    again = workspace.candidates(arm, 64, 0)
    assert np.array_equal(found.q, again.q)


def test_positions_with_a_tool_axis(arm):
    table = WorkspaceTable(
        position_m=[(0.55, 0.75), (-0.2, 0.2), (0.45, 0.45)],
        tool_axis=(0.0, 0.0, -1.0),
        rotation_deg=(-20.0, 20.0),
    )
    workspace = Workspace.from_table(table, arm)
    assert workspace.feature_names == ("x_m", "y_m", "rotation_deg")
    found = workspace.candidates(arm, 40, 0)
    assert len(found.q) >= 20
    rotation, position = arm.forward_batch(found.q)
    np.testing.assert_allclose(
        rotation[:, :, 2], np.tile([0, 0, -1.0], (len(found.q), 1)), atol=1e-5
    )
    np.testing.assert_allclose(position[:, 2], 0.45, atol=1e-5)
    assert workspace.contains(arm, found.q, 1e-5).all()
    collisions = Collisions(arm)
    assert all(collisions.free(q) for q in found.q)


def test_an_unreachable_workspace_says_why(arm):
    table = WorkspaceTable(position_m=[(5, 6), (0, 1), (0, 1)], tool_axis=(0.0, 0.0, -1.0))
    with pytest.raises(NoPoseLeftError, match="out of reach"):
        Workspace.from_table(table, arm).candidates(arm, 4, 0)


def test_a_box_beyond_the_limits_is_refused(arm):
    ranges = [(-200.0, 10.0), *JOINTS_DEG[1:]]
    with pytest.raises(InputError, match="joint_a1"):
        Workspace.from_table(WorkspaceTable(joints_deg=ranges), arm)


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
