"""Inverse kinematics of known robots: what can be reached is found, the rest is explained."""

import numpy as np
import pytest

from planner.proof.arms import ARMS
from planner.robot.collision import Collisions
from planner.robot.inverse_kinematics import solve
from planner.robot.robot import Robot
from tests.support.robots import make_arm

TARGETS = 60


@pytest.fixture(scope="module")
def arm(tmp_path_factory) -> Robot:
    return Robot.load(make_arm(tmp_path_factory.mktemp("arm")))


@pytest.fixture(scope="module", params=sorted(ARMS))
def known(request, tmp_path_factory) -> Robot:
    return Robot.load(ARMS[request.param].write(tmp_path_factory.mktemp(request.param)))


def reaches(robot, q, rotation, position) -> bool:
    again, place = robot.forward(q)
    near = np.allclose(again, rotation, atol=1e-5) and np.allclose(place, position, atol=1e-5)
    return near and bool(np.all((q >= robot.lower_rad) & (q <= robot.upper_rad)))


def test_what_a_robot_can_reach_is_found(known):
    """Targets that the forward kinematics reach within the limits, as any wrist may stand."""
    rng = np.random.default_rng(7)
    found = 0
    for q in rng.uniform(known.lower_rad, known.upper_rad, (TARGETS, 6)):
        rotation, position = known.forward(q)
        result = solve(known, rotation, position)
        if result.q is not None:
            assert result.reason == ""
            assert reaches(known, result.q, rotation, position)
            found += 1
    print(f"{known.name}: {found} of {TARGETS}")
    assert found >= 0.95 * TARGETS


def test_near_a_good_start_the_solution_stays_on_its_branch(known):
    rng = np.random.default_rng(3)
    name = next(k for k, v in ARMS.items() if v.name == known.name)
    for q in ARMS[name].poses(20, seed=5):
        rotation, position = known.forward(q)
        start = q + rng.uniform(-0.1, 0.1, 6)
        result = solve(known, rotation, position, start, restarts=0)
        assert result.q is not None
        np.testing.assert_allclose(result.q, q, atol=1e-4)


def test_what_is_found_touches_nothing(arm):
    """One solution of a target touches, another does not: the free one is given."""
    collisions = Collisions(arm)
    rng = np.random.default_rng(1)
    found = refused = 0
    for q in rng.uniform(arm.lower_rad, arm.upper_rad, (40, 6)):
        result = solve(arm, *arm.forward(q), q, collisions)
        if result.q is not None:
            assert collisions.free(result.q)
            found += 1
        else:
            assert not collisions.free(q)
            assert " touches " in result.reason
            refused += 1
    assert found > 0
    assert refused > 0


def test_the_same_call_gives_the_same_answer(arm):
    q = np.random.default_rng(11).uniform(arm.lower_rad, arm.upper_rad, (5, 6))
    for row in q:
        a, b = (solve(arm, *arm.forward(row), seed=4) for _ in range(2))
        assert a.q is not None
        assert b.q is not None
        assert a.reason == b.reason
        assert np.array_equal(a.q, b.q)


def test_a_target_beyond_the_arm_is_out_of_reach_by_what_is_missing(arm):
    """The arm stretched out is longest; a target further along the same line is that far off."""
    stretched = np.array([0, 0, np.arctan2(0.035, 0.515), 0, 0, 0])  # elbow and wrist in line
    rotation, position = arm.forward(stretched)
    shoulder = np.array([0.025, 0, 0.4])
    along = (position - shoulder) / np.linalg.norm(position - shoulder)
    result = solve(arm, rotation, position + 2.0 * along)
    assert result.q is None
    assert "out of reach" in result.reason
    missing = float(result.reason.split(" m ")[0].split()[-1])
    assert missing == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("above", [False, True])
def test_a_target_beyond_a_limit_names_that_joint_and_limit(tmp_path, above):
    """Turned about a vertical first joint: only that joint can bring the tool there."""
    path = make_arm(tmp_path)
    urdf = path.with_name("arm.urdf")
    urdf.write_text(
        urdf.read_text().replace(
            f'lower="{np.deg2rad(-170)}" upper="{np.deg2rad(170)}"',
            f'lower="{np.deg2rad(-20)}" upper="{np.deg2rad(20)}"',
            1,
        )
    )
    robot = Robot.load(path)
    inside, outside = np.deg2rad([[0, -40, 60, 0, 40, 0], [0, -40, 60, 0, 40, 0]])
    inside[0] = np.deg2rad(18 if above else -18)
    outside[0] = np.deg2rad(45 if above else -45)
    assert solve(robot, *robot.forward(inside), inside, restarts=0).q is not None
    result = solve(robot, *robot.forward(outside), inside, restarts=2)
    assert result.q is None
    limit = "above its limit of 20.0°" if above else "below its limit of -20.0°"
    assert result.reason == f"joint_a1 at {45.0 if above else -45.0}° is {limit}"
