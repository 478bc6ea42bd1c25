"""The robot as lines from joint to joint, for drawings of robots whose URDF has no shapes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from planner.robot.robot import Robot

APART_M = 1e-6  # joints nearer than this lie at one point


@dataclass(frozen=True, eq=False)
class BodyShape:
    """What turns with one joint: a link, and all that hang on it by fixed joints.

    `ends_m` (n, 3) says where, in the frame of `link`, the next joints and the tcp are; its own
    origin where they are nowhere else. Of joints that slide both ends of their way are among them.
    """

    link: str  # the one that the joint moves; the root of the URDF for the base
    links: tuple[str, ...]
    ends_m: np.ndarray


def bodies(robot: Robot) -> tuple[BodyShape, ...]:
    """The base, then one body a joint in the robot's order."""
    return tuple(_body(robot, number) for number in range(robot.model.njoints))


def _body(robot: Robot, number: int) -> BodyShape:
    model, tcp = robot.model, robot.model.frames[robot.tcp_id]
    frames = [f for f in model.frames if f.type == pin.FrameType.BODY and f.parentJoint == number]
    ends = [end for k in model.children[number] for end in _ends(robot, int(k))]
    ends += [tcp.placement.translation] if tcp.parentJoint == number else []
    apart = [np.array(end) for end in ends if np.linalg.norm(end) > APART_M]
    links = tuple(frame.name for frame in frames)
    return BodyShape(links[0], links, np.array(apart or [np.zeros(3)]))


def _ends(robot: Robot, joint: int) -> list[np.ndarray]:
    """Where a joint is on what carries it, (3,) each: of one that slides, both ends of its way."""
    place = robot.model.jointPlacements[joint]
    linkage, own = robot.linkage, joint - 1
    if not linkage.slides[own]:
        return [place.translation]
    way = linkage.at(robot.lower_rad)[own], linkage.at(robot.upper_rad)[own]
    return [place.translation + place.rotation @ (v * linkage.axes[own]) for v in way]


@dataclass(frozen=True, eq=False)
class Skeleton:
    """The robot at a pose as points (p, 3) in the world, m, and lines between pairs of them."""

    names: tuple[str, ...]  # frames of the URDF: the bodies' own, in their order, and the tcp
    place_m: np.ndarray
    lines: tuple[tuple[int, int], ...]


def skeleton(robot: Robot, q: np.ndarray) -> Skeleton:
    """Lines from joint to joint and to the tcp at joint angles q (dof,) in rad."""
    own, model = bodies(robot), robot.model
    names = (*(body.link for body in own), robot.config.tcp_frame)
    ids = [*(robot.frame_id("link", body.link) for body in own), robot.tcp_id]
    lines = [(int(model.parents[k]), k) for k in range(1, len(own))]
    lines.append((int(model.frames[robot.tcp_id].parentJoint), len(own)))
    return Skeleton(names, placements(robot, q, ids)[1], tuple(lines))


def placements(robot: Robot, q: np.ndarray, frames: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (n, 3, 3) and places (n, 3) of frames, by Pinocchio's numbers, in the world."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.linkage.at(q))
    rotation = np.array([data.oMf[i].rotation for i in frames]).reshape(-1, 3, 3)
    return rotation, np.array([data.oMf[i].translation for i in frames]).reshape(-1, 3)
