"""A workspace in front of a robot: ranges of its joints in which it can stand everywhere."""

from itertools import islice

import numpy as np

from planner.errors import NoPoseLeftError
from planner.robot.collision import Collisions
from planner.robot.inverse_kinematics import singularity
from planner.robot.robot import Robot

AHEAD = 0.55  # of the arm's length: where a workpiece is, seen from the shoulder
HALF_RAD, HALF_M = np.deg2rad(20.0), 0.25  # half widths of ranges, before they are narrowed
NARROWER = 0.7  # by which all are, as long as too many of their poses cannot be
REACHED = 0.75  # share of poses in the ranges that must be free
POSES, LOOKED_AT, NARROWINGS, SOME = 800, 48, 8, 8
DOWN = 0.3  # how much the tool's direction counts, against distances in units of the arm
SINGULAR = 0.01  # see `singularity`
UP = np.array([0.0, 0.0, 1.0])


def workspace_in_front(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper ends (dof,) in rad (slides: m) of ranges within the limits.

    Around one of the poses whose tool is nearest to a place ahead of the shoulder, pointing down:
    the one with the widest ranges. Raises NoPoseLeftError where the robot touches something at all
    poses that are looked at.
    """
    collisions, best, width = Collisions(robot), None, 0.0
    poses = _by_nearness(robot)
    regular = (q for q in poses if singularity(robot, q[None])[0] >= SINGULAR)
    free = [*islice(filter(collisions.free, regular), SOME)]
    free = free or [*islice(filter(collisions.free, poses), SOME)]  # of one singular everywhere
    for at in free:
        low, high, share = _narrowed(robot, collisions, at)
        if share > width:
            best, width = (low, high), share
        if share == 1.0:
            break
    if best is None:
        raise NoPoseLeftError(
            f"{robot.urdf_path}: the robot touches itself or an obstacle at all of {POSES} poses; "
            f"give a campaign.toml with [workspace] by --campaign."
        )
    return best


def _middle(robot: Robot) -> np.ndarray:
    """0 where the limits allow it, else the middle between them; of slides the middle."""
    middle = (robot.lower_rad + robot.upper_rad) / 2
    zero = (robot.lower_rad <= 0) & (robot.upper_rad >= 0) & ~np.array(robot.joints.slides)
    return np.where(zero, 0.0, middle)


def _by_nearness(robot: Robot) -> np.ndarray:
    """Poses (n, dof) within a third of a turn of the middle, the most suitable first."""
    rng, first, middle = np.random.default_rng(0), min(robot.tool_joints), _middle(robot)
    turns = next((k for k in robot.tool_joints if not robot.joints.slides[k]), first)
    away = np.where(robot.joints.slides, (robot.upper_rad - robot.lower_rad) / 4, 2 * np.pi / 3)
    away[turns] = min(away[turns], np.deg2rad(15.0))
    low, high = (np.clip(middle + s * away, robot.lower_rad, robot.upper_rad) for s in (-1, 1))
    q = rng.uniform(low, high, (POSES, len(middle)))
    arm = robot.arm_m or 1.0
    _, place = robot.forward_batch(q)
    target = _shoulder(robot, middle) + arm * AHEAD * _ahead(robot, middle)
    down = np.array([tool_direction(robot, one) @ -UP for one in q])
    cost = np.linalg.norm(place - target, axis=1) / arm + DOWN * (1 - down)
    return q[np.argsort(cost, kind="stable")]


def _shoulder(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Where the first turning joint of the tool's chain is (3,) at q (dof,)."""
    places = robot.joint_places(q)
    turning = [k for k in robot.tool_joints if not robot.joints.slides[k]]
    return places[min(turning or robot.tool_joints)][0]


def _ahead(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Horizontal direction (3,) in which the tool is at q (dof,); x where it is above the base."""
    away = (robot.forward(q)[1] - _shoulder(robot, q)) * [1, 1, 0]
    far = float(np.linalg.norm(away))
    return away / far if far > 0.1 * robot.arm_m and far > 0 else np.array([1.0, 0.0, 0.0])


def tool_direction(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Where the tool points (3,) in the world at q (dof,): off the arm, along its last axis."""
    places, tip = robot.joint_places(q), robot.forward(q)[1]
    last = max((k for k in robot.tool_joints if not robot.joints.slides[k]), default=0)
    axis = places[last][1]
    for number in reversed(robot.tool_joints):
        along = float(axis @ (tip - places[number][0]))
        if abs(along) > 1e-3:
            return np.sign(along) * axis
    return axis


def _narrowed(
    robot: Robot, collisions: Collisions, at: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Ranges around a free pose (dof,), narrowed until most poses in them are free; by how much."""
    full, share = np.where(robot.joints.slides, HALF_M, HALF_RAD), 1.0
    for _ in range(NARROWINGS):
        low, high = (
            np.clip(at + s * share * full, robot.lower_rad, robot.upper_rad) for s in (-1, 1)
        )
        q = np.random.default_rng(1).uniform(low, high, (LOOKED_AT, len(at)))
        if np.mean([collisions.free(one) for one in q]) >= REACHED:
            return low, high, share
        share = NARROWER * share
    return at, at, 0.0
