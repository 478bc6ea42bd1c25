"""The workspace: where the model has to be good, its coordinates, and reachable candidates.

Where none is stated, ranges of the joints in front of the robot, in which it can stand everywhere.
"""

from collections import Counter
from dataclasses import dataclass
from itertools import islice

import numpy as np

from planner.errors import InputError, NoPoseLeftError
from planner.robot.collision import Collisions
from planner.robot.config import WorkspaceTable
from planner.robot.inverse_kinematics import singularity, solve
from planner.robot.robot import Robot

TRIES = 4  # points tried per candidate wanted, before a sparse workspace is accepted as such


@dataclass(frozen=True, eq=False)
class Candidates:
    """Reachable poses: angles (n, dof) in rad, model coordinates (n, d), tcp positions (n, 3)."""

    q: np.ndarray
    features: np.ndarray
    position_m: np.ndarray
    rejected: dict[str, int]  # why points of the workspace were left out


@dataclass(frozen=True, eq=False)
class Workspace:
    """A box of joints (rad; m of slides), or of tcp position (m), rotation about its axis (rad).

    Model coordinates are the box's own, scaled to [0, 1], without those that do not vary.
    """

    lower: np.ndarray
    upper: np.ndarray
    names: tuple[str, ...]
    tool_axis: np.ndarray | None = None  # None: joint box

    @classmethod
    def from_table(cls, table: WorkspaceTable, robot: Robot) -> "Workspace":
        """From campaign.toml; InputError where the table does not suit the robot."""
        if table.joints_deg is not None:
            return _joint_box(cls, table.joints_deg, robot)
        assert table.position_m is not None
        assert table.tool_axis is not None
        axis = np.array(table.tool_axis, dtype=float)
        if not abs(np.linalg.norm(axis) - 1) < 1e-3:
            raise InputError("[workspace] tool_axis is no unit vector; give a direction.")
        rotation = np.deg2rad(table.rotation_deg or (0.0, 0.0))
        box = np.array([*table.position_m, rotation], dtype=float)
        names = ("x_m", "y_m", "z_m", "rotation_deg")
        return cls(box[:, 0], box[:, 1], names, axis / np.linalg.norm(axis))

    @property
    def varying(self) -> np.ndarray:
        """Which coordinates of the box vary."""
        return self.upper > self.lower

    @property
    def feature_names(self) -> tuple[str, ...]:
        """Names of the model coordinates."""
        return tuple(n for n, v in zip(self.names, self.varying, strict=True) if v)

    def coordinates(self, robot: Robot, q: np.ndarray) -> np.ndarray:
        """Coordinates (n, box) of poses (n, dof), unscaled."""
        q = np.atleast_2d(q)
        if self.tool_axis is None:
            return q
        rotation, position = robot.forward_batch(q)
        reference, normal = self._directions()
        x = rotation[:, :, 0]
        angle = np.arctan2(x @ normal, x @ reference)
        return np.column_stack([position, angle])

    def features(self, robot: Robot, q: np.ndarray) -> np.ndarray:
        """Model coordinates (n, d) of poses q (n, dof) in rad; in [0, 1] inside the workspace."""
        varying = self.varying
        scaled = self.coordinates(robot, q)[:, varying] - self.lower[varying]
        return scaled / (self.upper - self.lower)[varying]

    def contains(self, robot: Robot, q: np.ndarray, tolerance: float = 1e-6) -> np.ndarray:
        """(n,) bool: whether poses q (n, dof) lie in the workspace, the tool along its axis."""
        c = self.coordinates(robot, q)
        along = np.ones(len(c), dtype=bool)
        if self.tool_axis is not None:
            # Angles that differ by whole turns are one: the one nearest to the box is meant.
            middle = (self.lower[3] + self.upper[3]) / 2
            c[:, 3] -= 2 * np.pi * np.round((c[:, 3] - middle) / (2 * np.pi))
            axes = robot.forward_batch(np.atleast_2d(q))[0][:, :, 2]
            along = np.linalg.norm(np.cross(axes, self.tool_axis), axis=1) <= tolerance
            along &= axes @ self.tool_axis > 0
        inside = (c >= self.lower - tolerance) & (c <= self.upper + tolerance)
        return np.all(inside, axis=1) & along

    def candidates(self, robot: Robot, n: int, seed: int) -> Candidates:
        """Up to n reachable poses spread evenly (Sobol); the same for the same seed.

        Raises NoPoseLeftError, saying what stands in the way, if there is none.
        """
        collisions, rejected = Collisions(robot), Counter()
        dimensions = int(self.varying.sum())
        points = np.tile(self.lower, (1 if dimensions == 0 else TRIES * n, 1))
        if dimensions:
            from scipy.stats import qmc  # scipy.stats takes most of a second to import

            sampler = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed))
            exponent = int(np.ceil(np.log2(TRIES * n)))
            unit = sampler.random_base2(exponent)[: TRIES * n]
            span = (self.upper - self.lower)[self.varying]
            points[:, self.varying] = self.lower[self.varying] + unit * span
        found: list[np.ndarray] = []
        places: list[np.ndarray] = []
        for point in points:
            if len(found) == n:
                break
            q, reason = self._posed(robot, point, collisions, found, places)
            if q is None or reason:
                rejected[reason] += 1
            else:
                found.append(q)
                places.append(point)
        if not found:
            reason, _ = rejected.most_common(1)[0]
            raise NoPoseLeftError(
                f"No pose of the workspace can be reached ({reason}); change [workspace]."
            )
        q = np.array(found)
        return Candidates(q, self.features(robot, q), robot.forward_batch(q)[1], dict(rejected))

    def _posed(
        self,
        robot: Robot,
        point: np.ndarray,
        collisions: Collisions,
        found: list[np.ndarray],
        places: list[np.ndarray],
    ) -> tuple[np.ndarray | None, str]:
        """Angles at a point, and what keeps the robot from standing there, "" if nothing does.

        IK is from the nearest solved neighbour, so that one branch of solutions is kept.
        """
        if self.tool_axis is None:
            return point, "" if collisions.free(point) else collisions.violations(point)[0]
        if not found:
            return self._first_branch(robot, point, collisions)
        distance = np.linalg.norm((np.array(places) - point), axis=1)
        near = found[int(np.argmin(distance))]
        result = solve(robot, self.rotation(point[3]), point[:3], near, collisions, restarts=0)
        return result.q, result.reason

    def _first_branch(
        self, robot: Robot, point: np.ndarray, collisions: Collisions
    ) -> tuple[np.ndarray | None, str]:
        """Of several solutions, the one farthest from the joint limits."""
        best, margin, reason = None, -1.0, ""
        for seed in range(8):
            rng = np.random.default_rng(seed)
            start = rng.uniform(robot.lower_rad, robot.upper_rad)
            result = solve(robot, self.rotation(point[3]), point[:3], start, collisions, 4, seed)
            if result.q is None:
                reason = reason or result.reason
                continue
            room = np.minimum(result.q - robot.lower_rad, robot.upper_rad - result.q)
            share = float(np.min(room / (robot.upper_rad - robot.lower_rad)))
            if share > margin + 1e-6:
                best, margin = result.q, share
        return (best, "") if best is not None else (None, reason)

    def rotation(self, angle_rad: float) -> np.ndarray:
        """Rotation (3, 3) of the tcp for a rotation about the tool axis."""
        assert self.tool_axis is not None
        reference, normal = self._directions()
        x = np.cos(angle_rad) * reference + np.sin(angle_rad) * normal
        return np.column_stack([x, np.cross(self.tool_axis, x), self.tool_axis])

    def _directions(self) -> tuple[np.ndarray, np.ndarray]:
        """The tcp's x axis at rotation 0 (world x, or y, across the tool axis), and at 90°."""
        assert self.tool_axis is not None
        world = np.array([1.0, 0, 0]) if abs(self.tool_axis[0]) < 0.999 else np.array([0, 1.0, 0])
        reference = world - (world @ self.tool_axis) * self.tool_axis
        reference /= np.linalg.norm(reference)
        return reference, np.cross(self.tool_axis, reference)


def ranges_inside(
    robot: Robot, lower: np.ndarray, upper: np.ndarray, parts: float = 1000.0
) -> list[list[float]]:
    """Ranges as campaign.toml states them, rounded inwards to `parts` of a degree (slides: mm)."""
    low, high = robot.joints.shown([lower, upper]) * parts
    rounded = np.array([np.ceil(low - 1e-6), np.floor(high + 1e-6)]) / parts
    rounded = np.where(rounded[0] <= rounded[1], rounded, np.array([low, high]) / parts)
    return (rounded.T + 0.0).tolist()


def _joint_box(cls, ranges: list[tuple[float, float]], robot: Robot) -> Workspace:
    names = robot.joint_names
    if len(ranges) != len(names):
        raise InputError(
            f"[workspace] joints_deg has {len(ranges)} ranges, the robot {len(names)} joints; "
            f"give one range a joint."
        )
    box = robot.joints.internal(np.array(ranges, dtype=float).T).T
    slack = 1e-6
    for i, name in enumerate(names):
        if box[i, 0] < robot.lower_rad[i] - slack or box[i, 1] > robot.upper_rad[i] + slack:
            low, high = (
                robot.joints.text(i, robot.joints.shown(limits)[i])
                for limits in (robot.lower_rad, robot.upper_rad)
            )
            raise InputError(
                f"[workspace] joints_deg of {name} is {list(ranges[i])}, its limits are "
                f"{low} to {high}; narrow the range."
            )
    lower = np.maximum(box[:, 0], robot.lower_rad)
    upper = np.minimum(box[:, 1], robot.upper_rad)
    return cls(lower, upper, robot.joints.columns)


AHEAD = 0.55  # of the arm's length: where a workpiece is, seen from the shoulder
HALF_RAD, HALF_M = np.deg2rad(20.0), 0.25  # half widths of ranges, before they are narrowed
NARROWER = 0.7  # by which all are, as long as too many of their poses cannot be
REACHED = 0.75  # share of poses in the ranges that must be free
POSES, LOOKED_AT, NARROWINGS, SOME = 800, 48, 8, 8
DOWN, BENT = 0.3, 0.3  # how much the tool's direction counts, and how far joints stand from their
# middles on the mean, against distances in units of the arm
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


def _by_nearness(robot: Robot) -> np.ndarray:
    """Poses (n, dof) within a third of a turn of the middle, the most suitable first.

    The middle is 0 where a joint turns and its limits allow it.
    """
    slides, joint = np.array(robot.joints.slides), _shoulder(robot)
    zero = (robot.lower_rad <= 0) & (robot.upper_rad >= 0) & ~slides
    middle = np.where(zero, 0.0, robot.middle_rad)
    away = np.where(slides, (robot.upper_rad - robot.lower_rad) / 4, 2 * np.pi / 3)
    away[joint] = min(away[joint], np.deg2rad(15.0))
    low, high = (np.clip(middle + s * away, robot.lower_rad, robot.upper_rad) for s in (-1, 1))
    q = np.random.default_rng(0).uniform(low, high, (POSES, len(middle)))
    arm, shoulder = robot.arm_m or 1.0, robot.joint_places(middle)[joint][0]
    _, place = robot.forward_batch(q)
    ahead = (robot.forward(middle)[1] - shoulder) * [1, 1, 0]
    far = float(np.linalg.norm(ahead))  # where the tool is above the base, x is ahead
    ahead = ahead / far if far > 0.1 * robot.arm_m and far > 0 else np.array([1.0, 0.0, 0.0])
    target = shoulder + arm * AHEAD * ahead
    down = np.array([tool_direction(robot, one) @ -UP for one in q])
    bent = np.mean(np.abs(q - middle) / np.maximum(away, 1e-9), axis=1)
    cost = np.linalg.norm(place - target, axis=1) / arm + DOWN * (1 - down) + BENT * bent
    return q[np.argsort(cost, kind="stable")]


def _shoulder(robot: Robot) -> int:
    """Place in q of the first joint of the tool's chain that turns, or else the first."""
    turning = [k for k in robot.tool_joints if not robot.joints.slides[k]]
    return min(turning or robot.tool_joints)


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
