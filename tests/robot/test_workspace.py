"""Workspaces, inverse kinematics: what can be reached is found, the rest is explained."""

import numpy as np
import pytest
from scipy.stats import qmc

from planner.campaign.config import WorkspaceTable
from planner.errors import NoPoseLeftError
from planner.proof.arms import ARMS, KR10, KR210
from planner.robot.collision import Collisions
from planner.robot.inverse_kinematics import solve
from planner.robot.robot import Robot
from planner.robot.workspace import Workspace
from tests.support.robots import JOINTS_DEG, make_arm

DOWN = (0.0, 0.0, -1.0)


@pytest.fixture(scope="module")
def arm(tmp_path_factory) -> Robot:
    return Robot.load(make_arm(tmp_path_factory.mktemp("arm")))


def joints(*ranges) -> WorkspaceTable:
    return WorkspaceTable(joints_deg=list(ranges or JOINTS_DEG))


def places(x=(0.55, 0.75), y=(-0.2, 0.2), z=(0.4, 0.5), axis=DOWN, rotation=None):
    return WorkspaceTable(position_m=[x, y, z], tool_axis=axis, rotation_deg=rotation)


TABLES = {
    "joints": joints(),
    "three joints": joints((0, 0), (-110, -50), (60, 120), (0, 0), (10, 70), (0, 0)),
    "box": places(),
    "plane": places(z=(0.45, 0.45)),
    "line": places(x=(0.6, 0.6), z=(0.45, 0.45)),
    "box with rotation": places(rotation=(-40.0, 25.0)),
    "tool ahead": places(axis=(1.0, 0.0, 0.0), rotation=(60.0, 120.0)),
    "tool aslant": places(axis=(0.6, 0.0, -0.8), rotation=(-10.0, 10.0)),
}


@pytest.mark.parametrize("name", TABLES)
def test_candidates_are_inside_reachable_and_the_same_again(arm, name):
    workspace = Workspace.from_table(TABLES[name], arm)
    found = workspace.candidates(arm, 32, seed=5)
    n, d = len(found.q), len(workspace.feature_names)
    assert n == 32 or found.rejected
    assert n >= 16
    assert found.features.shape == (n, d)
    assert np.all((found.features >= -1e-5) & (found.features <= 1 + 1e-5))
    np.testing.assert_array_equal(found.features, workspace.features(arm, found.q))
    assert workspace.contains(arm, found.q, 1e-5).all()
    collisions = Collisions(arm)
    assert all(collisions.violations(q) == () for q in found.q)
    rotation, place = arm.forward_batch(found.q)
    np.testing.assert_allclose(found.position_m, place)
    if TABLES[name].tool_axis is not None:
        angles = workspace.coordinates(arm, found.q)[:, 3]
        stands = np.array([workspace.rotation(angle) for angle in angles])
        np.testing.assert_allclose(rotation, stands, atol=1e-5)
        np.testing.assert_allclose(stands[:, :, 2], np.tile(TABLES[name].tool_axis, (n, 1)))
    again = workspace.candidates(arm, 32, seed=5)
    assert np.array_equal(found.q, again.q)
    assert found.rejected == again.rejected
    assert not np.array_equal(found.q, workspace.candidates(arm, 32, seed=6).q)


def test_candidates_are_spread_evenly(arm):
    workspace = Workspace.from_table(TABLES["three joints"], arm)
    found = workspace.candidates(arm, 64, seed=0)
    assert found.rejected == {}
    random = np.random.default_rng(0).random((64, 3))
    assert qmc.discrepancy(found.features) < 0.5 * qmc.discrepancy(random)


def test_joint_features_are_the_share_of_the_range(arm):
    workspace = Workspace.from_table(joints(), arm)
    low, high = np.deg2rad(JOINTS_DEG).T
    share = np.random.default_rng(0).random((7, 6))
    features = workspace.features(arm, low + share * (high - low))
    np.testing.assert_allclose(features, share, atol=1e-12)
    assert workspace.feature_names == tuple(f"joint_a{i}_deg" for i in range(1, 7))


def test_what_lies_outside_is_not_contained(arm):
    workspace = Workspace.from_table(TABLES["plane"], arm)
    inside = workspace.candidates(arm, 8, seed=0).q
    beside = inside + np.deg2rad([40, 0, 0, 0, 0, 0])  # turns the tool, too
    raised = inside + np.deg2rad([0, -4, 0, 0, 0, 0])  # leaves plane and direction
    assert workspace.contains(arm, inside, 1e-5).all()
    assert not workspace.contains(arm, beside, 1e-5).any()
    assert not workspace.contains(arm, raised, 1e-5).any()
    box = Workspace.from_table(joints(), arm)
    edge = np.array([box.lower, box.upper, box.lower - 1e-3])
    assert box.contains(arm, edge).tolist() == [True, True, False]


def test_neighbours_in_the_workspace_are_neighbours_in_joints(tmp_path):
    """One branch of solutions is kept, so that a smooth model can be learnt over it."""
    robot = Robot.load(KR210.write(tmp_path))
    table = places((1.5, 2.1), (-0.6, 0.6), (1.2, 1.2))
    found = Workspace.from_table(table, robot).candidates(robot, 60, seed=0)
    assert len(found.q) == 60
    apart = np.linalg.norm(found.position_m[:, None] - found.position_m[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    nearest = np.argmin(apart, axis=1)
    jump = np.max(np.abs(found.q - found.q[nearest]), axis=1)
    assert np.median(jump) < np.deg2rad(25)
    assert np.ptp(np.sign(found.q[:, 4])) == 0  # joint 5 does not flip


def test_a_single_pose_is_a_workspace(tmp_path):
    robot = Robot.load(KR10.write(tmp_path))
    fixed = joints(*[(float(a), float(a)) for a in (0, -80, 80, 0, 45, 0)])
    found = Workspace.from_table(fixed, robot).candidates(robot, 5, seed=0)
    np.testing.assert_allclose(found.q, np.deg2rad([[0, -80, 80, 0, 45, 0]]))
    assert found.features.shape == (1, 0)


@pytest.mark.parametrize(
    ("table", "reason"),
    [
        (places(x=(5, 6)), "out of reach"),
        (places(x=(0.3, 0.5), z=(-0.08, -0.06)), "touches"),
        (joints((0, 0), (44, 45), (39, 40), (0, 0), (0, 0), (0, 0)), "touches"),
    ],
)
def test_without_any_pose_the_reason_is_said(arm, table, reason):
    with pytest.raises(NoPoseLeftError, match=reason) as caught:
        Workspace.from_table(table, arm).candidates(arm, 2, seed=0)
    said = str(caught.value)
    assert said.endswith("change [workspace].")
    assert "\n" not in said


def test_rejections_are_counted_by_reason(arm):
    """A wide box: some of it can be reached."""
    table = joints((0, 0), (-60, 45), (0, 90), (0, 0), (0, 0), (0, 0))
    found = Workspace.from_table(table, arm).candidates(arm, 40, seed=0)
    assert any("touches floor" in reason for reason in found.rejected)
    assert all(count > 0 for count in found.rejected.values())
    assert len(found.q) + sum(found.rejected.values()) <= 4 * 40


TARGETS = 60


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
