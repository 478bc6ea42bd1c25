"""The poses of a milling path on a robot, and what other feeds and turns would allow there."""

from dataclasses import dataclass, replace

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from planner.campaign.cut_source import CampaignPoses, StabilityRequest, ToolChange
from planner.errors import InputError
from planner.milling.cut import Cut
from planner.milling.path import limit_at
from planner.milling.tool import frame_along
from planner.milling.toolpath import Toolpath, is_toolpath, read_toolpath
from planner.progress import ProgressCallback, no_progress
from planner.recording.folder import read_poses
from planner.robot.collision import Collisions
from planner.robot.inverse_kinematics import solve
from planner.robot.robot import Robot

TURN_DEG = 30.0  # between angles about the tool's axis that are tried
TURNS_DEG = np.arange(0.0, 360.0, TURN_DEG)
STARTS = 4  # from which the first pose of a program is looked for, for each turn


def path_poses(asked: StabilityRequest, cut: Cut) -> CampaignPoses:
    """Of a campaign; InputError where a pose cannot be reached, or the path is missing."""
    path = asked.path
    if path is None:
        raise InputError(
            f"{asked.source} is a campaign: name the path with --path, as a CSV of poses or a "
            f"program (G-code, APT)."
        )
    change = ToolChange.of(asked, cut)
    campaign = asked.campaign
    cell = campaign.cell
    if is_toolpath(path):
        names, q, feeds = _program(cell.robot, asked, read_toolpath(path), cut)
        return CampaignPoses(campaign, names, q, change, feeds)
    if asked.origin is not None:
        raise InputError(f"{path} holds joint angles; --origin goes with a program.")
    rows = read_poses(path, cell.robot.joints)
    q = [cell.check_pose(row.joints_deg, f"{path}, row {row.row}") for row in rows]
    if not q:
        raise InputError(f"{path} holds no pose; give one a row.")
    return CampaignPoses(campaign, tuple(row.pose for row in rows), np.array(q), change)


def _origin_m(asked: StabilityRequest) -> np.ndarray:
    """(3,) of a program's zero in the robot's base frame."""
    try:
        found = np.array([float(part) for part in (asked.origin or "").split(",")])
    except ValueError:
        found = np.zeros(0)
    if len(found) != 3 or not np.all(np.abs(found) < 1e3):
        raise InputError(
            f"{asked.path} is a program: say where its zero lies in the robot's base frame by "
            f"--origin X,Y,Z in m, as 1.5,0,0.8."
        )
    return found


def _turned(robot: Robot, here: np.ndarray, axis: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """Angles in degrees, and q (dof,) turned by them about the tool, where the robot can stand.

    From angle to angle it stays on its branch.
    """
    collisions, (rotation, position) = Collisions(robot), robot.forward(here)
    found = {0.0: here}
    for sense in (1.0, -1.0):
        near = here
        for turn in TURNS_DEG[1:]:
            angle = float(sense * turn) % 360
            if angle in found:
                break
            q = solve(robot, rotation @ about(axis, angle), position, near, collisions, 0).q
            if q is None:
                break
            near = found[angle] = q
    return list(found.items())


def _feeds_in_base(at: CampaignPoses, cut: Cut) -> np.ndarray:
    """Feeds (p, 3) in the base frame, as the cut or the path has them."""
    rotation, position = at.campaign.cell.robot.forward_batch(at.q)
    feed = np.array(cut.feed)
    if cut.feed_in != "path":
        return np.tile(feed, (len(rotation), 1)) if cut.feed_in == "base" else rotation @ feed
    return np.gradient(position, axis=0) if at.feeds is None else at.feeds


def feed_in_base(at: CampaignPoses, cut: Cut, turn_deg: float) -> tuple[float, float, float] | None:
    """The feed turned about the tool's axis, in the base frame; None if poses differ in it."""
    rotation, _ = at.campaign.cell.robot.forward_batch(at.q)
    axis = rotation @ (np.array(cut.axis) / np.linalg.norm(cut.axis))
    feed = _feeds_in_base(at, cut)
    feed = feed - axis * np.sum(feed * axis, axis=1, keepdims=True)
    feed /= np.linalg.norm(feed, axis=1, keepdims=True)
    turn = np.deg2rad(turn_deg)
    turned = np.cos(turn) * feed + np.sin(turn) * np.cross(axis, feed)
    if np.max(np.linalg.norm(turned - turned[0], axis=1)) > SAME:
        return None
    x, y, z = (float(v) for v in turned[0])
    return x, y, z


SAME = 0.02  # by which unit vectors that are the same may differ


def about(axis: np.ndarray, turn_deg: float) -> np.ndarray:
    """(3, 3) rotation about an axis (3,)."""
    turn = turn_deg * axis / np.linalg.norm(axis)
    return Rotation.from_rotvec(turn, degrees=True).as_matrix()


def _program(
    robot: Robot, asked: StabilityRequest, path: Toolpath, cut: Cut
) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    """Names, angles (p, dof) and feeds (p, 3): the first turn at which all can be reached."""
    position, feeds, names = path.points(asked.poses)
    position = position + _origin_m(asked)
    collisions, reasons = Collisions(robot), []
    for turn in TURNS_DEG:
        rotation = _upright(np.array(cut.axis), path.spindle, float(turn))
        for seed in range(STARTS):
            q, reason = _followed(robot, rotation, position, collisions, seed)
            if q is not None:
                return names, q, feeds
            reasons.append(reason)
    at, reason = max(reasons, key=lambda one: one[0])
    raise InputError(
        f"{asked.path}: {names[at]} cannot be reached at any turn about the tool's axis "
        f"({reason}); check --origin and the axis in the cut's file."
    )


def _upright(axis: np.ndarray, spindle: np.ndarray, turn_deg: float) -> np.ndarray:
    """Rotation (3, 3) of a tcp whose own axis (3,) is to point along `spindle` of the base."""
    return about(spindle, turn_deg) @ frame_along(spindle) @ frame_along(axis).T


def _followed(
    robot: Robot, rotation: np.ndarray, position: np.ndarray, collisions: Collisions, seed: int
) -> tuple[np.ndarray | None, tuple[int, str]]:
    """Angles (p, dof) on one branch, or the first pose that fails and why."""
    rng = np.random.default_rng(seed)
    near = rng.uniform(robot.lower_rad, robot.upper_rad)
    found = []
    for i, place in enumerate(position):
        result = solve(robot, rotation, place, near, collisions, 0 if found else 4, seed)
        if result.q is None:
            return None, (i, result.reason)
        near = result.q
        found.append(result.q)
    return np.array(found), (len(position), "")


WORTH_PERCENT = 5.0  # more depth: less is not worth a change of the program


@dataclass(frozen=True)
class FeedAdvice:
    """What turning the feed about the tool's axis would allow at the best speed.

    Angles in degrees from the feed as it is towards axis × feed, depths in m that all poses allow.
    `direction_base` is the best feed in the robot's base frame, where that is one for all poses.
    """

    turn_deg: tuple[float, ...]
    depth_m: tuple[float, ...]
    direction_base: tuple[float, float, float] | None = None

    @property
    def best(self) -> int:
        """Number of the best angle."""
        return int(np.argmax(self.depth_m))

    @property
    def text(self) -> str:
        """One sentence."""
        if not np.isfinite(self.depth_m[0]):
            return ""
        gain = 100 * (self.depth_m[self.best] / self.depth_m[0] - 1)
        if not gain > WORTH_PERCENT:
            return "Another feed direction gains less than 5 % of depth."
        if not np.isfinite(gain):
            return f"Turned by {self.turn_deg[self.best]:g}° the feed allows every depth asked for."
        base = ""
        if self.direction_base is not None:
            base = (
                " (along [" + ", ".join(f"{v:.2f}" for v in self.direction_base) + "] of the base)"
            )
        return (
            f"Turned by {self.turn_deg[self.best]:g}° about the tool's axis{base}, the feed allows "
            f"{gain:.0f} % more depth."
        )


@dataclass(frozen=True)
class TurnAdvice:
    """What each pose allows by angle about the tool, at one speed, without uncertainty.

    `depth_m[pose][angle]` in m is null where the robot cannot stand so, and where every depth asked
    for is stable; `best_deg` by pose, `common_deg` the angle that suits all poses best.
    """

    turn_deg: tuple[float, ...]
    depth_m: tuple[tuple[float, ...], ...]
    reached: tuple[tuple[bool, ...], ...]
    best_deg: tuple[float, ...]
    common_deg: float

    def text(self, poses: tuple[str, ...]) -> str:
        """Sentences."""
        depth = np.array(self.depth_m)
        now, common = (
            float(np.min(depth[:, self.turn_deg.index(a)])) for a in (0.0, self.common_deg)
        )
        best = float(np.min(np.nanmax(depth, axis=1)))
        if not best > now * (1 + WORTH_PERCENT / 100):
            return "Turning the robot about the tool's axis gains less than 5 % of depth."
        said = (
            f"Turned about the tool's axis by {self.common_deg:g}° at all poses the robot allows "
        )
        if self.common_deg == 0:
            said = "No one turn about the tool's axis suits all poses better; as it is they allow "
        said += f"{1e3 * common:.3f} mm (now {1e3 * now:.3f})"
        each = ", ".join(f"{n} {a:g}°" for n, a in zip(poses[:6], self.best_deg, strict=False))
        more = ", …" if len(poses) > 6 else ""
        return f"{said}; each pose at its own best angle ({each}{more}) {1e3 * best:.3f} mm."


def turn_advice(
    at: CampaignPoses, cut: Cut, rpm: float, progress: ProgressCallback = no_progress
) -> TurnAdvice:
    """At a speed in rpm, of each pose and angle."""
    robot, axis = at.campaign.cell.robot, np.array(cut.axis)
    found = [(i, *one) for i, here in enumerate(at.q) for one in _turned(robot, here, axis)]
    turned = replace(
        at,
        names=tuple(f"{at.names[i]}, turned {turn:g}°" for i, turn, _ in found),
        q=np.array([q for _, _, q in found]),
        feeds=_feeds_in_base(at, cut)[[i for i, _, _ in found]],
    )
    depth = np.full((len(at.q), len(TURNS_DEG)), np.nan)
    # With the feeds as they are in the base frame, whatever the cut says.
    poses = turned.structures(msgspec.structs.replace(cut, feed_in="path"))
    for k, ((i, turn, _), (_, structure)) in enumerate(zip(found, poses, strict=True)):
        depth[i, int(np.argmin(np.abs(TURNS_DEG - turn)))] = limit_at(structure.machine(cut), rpm)
        progress("turns", (k + 1) / len(found))
    known = np.where(np.isnan(depth), -1.0, depth)  # inf where none is lost
    return TurnAdvice(
        tuple(TURNS_DEG.tolist()),
        tuple(map(tuple, depth.tolist())),
        tuple(map(tuple, (~np.isnan(depth)).tolist())),
        tuple(TURNS_DEG[known.argmax(axis=1)].tolist()),
        float(TURNS_DEG[known.min(axis=0).argmax()]),
    )
