"""The robot at a pose as lines from joint to joint, boxes and frames, for drawings."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from planner.robot.link_bodies import LinkBody
from planner.robot.robot import Robot
from planner.robot.shapes import shape_corners

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


@dataclass(frozen=True, eq=False)
class RobotLines:
    """All in m, in the world.

    `links` are (start, end), `joints` (name, place, axis), `frames` (name, place, rotation) of tcp
    and sensor (one where both are one), `masses` (kg, place), `shapes` and `obstacles` corners
    (8, 3) of boxes.
    """

    links: list[tuple[np.ndarray, np.ndarray]]
    joints: list[tuple[str, np.ndarray, np.ndarray]]
    frames: list[tuple[str, np.ndarray, np.ndarray]]
    masses: list[tuple[float, np.ndarray]]
    shapes: list[np.ndarray]
    obstacles: list[np.ndarray]


def robot_lines(robot: Robot, q: np.ndarray, links: tuple[LinkBody, ...]) -> RobotLines:
    """The robot at q (dof,) in rad."""
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, robot.linkage.at(q))

    def place_of(name: str) -> pin.SE3:
        return data.oMf[model.getFrameId(name, pin.FrameType.BODY)]

    axes = zip(robot.joint_names, robot.joint_axes, robot.linkage.leads, strict=True)
    joints = [
        (name, data.oMi[k + 1].translation.copy(), data.oMi[k + 1].rotation @ axis)
        for name, axis, k in axes
    ]
    named = {robot.config.tcp_frame: robot.tcp_id, robot.config.sensor_frame: robot.sensor_id}
    frames = [
        (name, data.oMf[number].translation.copy(), data.oMf[number].rotation.copy())
        for name, number in named.items()
    ]
    masses = [(b.mass, place_of(b.name).act(b.com_m)) for b in links if b.joint and b.mass > 0]
    shapes = []
    root = ElementTree.fromstring(robot.urdf_text)
    for name, corners in shape_corners(root).items():
        for box in np.array(corners).reshape(-1, 8, 3):
            shapes.append(np.array([place_of(name).act(corner) for corner in box]))
    return RobotLines(_links(robot, data), joints, frames, masses, shapes, _obstacles(robot))


def _links(robot: Robot, data: pin.Data) -> list[tuple[np.ndarray, np.ndarray]]:
    found = []
    for number, body in enumerate(bodies(robot)):
        for end in body.ends_m:
            if np.any(end):
                place = data.oMi[number]
                found.append((place.translation.copy(), place.act(np.asarray(end))))
    return found


def _obstacles(robot: Robot) -> list[np.ndarray]:
    found = []
    for block in robot.config.obstacle:
        rotation = pin.rpy.rpyToMatrix(*np.deg2rad(block.rpy_deg))
        half = np.array(block.size_m) / 2
        signs = 2 * np.array(list(np.ndindex(2, 2, 2))) - 1
        found.append(np.array(block.center_m) + (signs * half) @ rotation.T)
    return found
