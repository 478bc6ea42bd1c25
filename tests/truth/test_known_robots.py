"""The arms that other tests use are sound: they stand free, and their modes lie in the band."""

import numpy as np
import pytest

from planner.robot.collision import Collisions
from planner.robot.robot import Robot
from planner.truth.arms import ARMS
from planner.truth.load import load_truth

PER_ROBOT = 40


@pytest.mark.parametrize("name", sorted(ARMS))
def test_workspace_is_free_and_within_limits(tmp_path, name):
    known = ARMS[name]
    collisions = Collisions(Robot.load(known.write(tmp_path)))
    poses = known.poses(PER_ROBOT)
    assert all(collisions.limits(q) == () for q in poses)
    free = [collisions.contacts(q) == () for q in poses]
    assert np.mean(free) > 0.9


@pytest.mark.parametrize("name", sorted(ARMS))
@pytest.mark.parametrize("per_joint", [1, 2, 3])
def test_elastic_rotations_and_modes(tmp_path, name, per_joint):
    known = ARMS[name]
    truth = load_truth(known.write(tmp_path, per_joint))
    assert len(truth.springs) == 6 * per_joint
    for spring, joint in zip(truth.springs[::per_joint], known.joints, strict=True):
        assert spring.axis == pytest.approx(joint.axis)  # the first is about the joint itself
    low, high = known.band_hz
    for q in known.poses(10):
        frequency, damping, _ = truth.modes(q, 3)
        assert np.all((frequency > low) & (frequency < high))
        assert np.all((damping > 0.005) & (damping < 0.1))


@pytest.mark.parametrize("name", sorted(ARMS))
def test_turning_about_a_joint_turns_the_tool_about_its_axis(tmp_path, name):
    """Placements typed in: the wrist's last joint turns the tool about the tool's own axis."""
    truth = load_truth(ARMS[name].write(tmp_path))
    q = ARMS[name].poses(1)[0]
    before, after = truth.tcp(q)[0], truth.tcp(q + np.eye(6)[5])[0]
    assert np.allclose(before[:, 2], after[:, 2], atol=1e-12)
    assert before[:, 0] @ after[:, 0] == pytest.approx(np.cos(1.0), abs=1e-12)
