"""A robot at a pose as lines, boxes and frames in the world, for drawings."""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from planner.robot.link_bodies import LinkBody
from planner.robot.robot import Robot
from planner.robot.shapes import shape_corners
from planner.robot.skeleton import bodies


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
    return RobotLines(_skeleton(robot, data), joints, frames, masses, shapes, _obstacles(robot))


def _skeleton(robot: Robot, data: pin.Data) -> list[tuple[np.ndarray, np.ndarray]]:
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
