"""Lines that stand for the links of a robot whose URDF has no collision shapes."""

from collections.abc import Iterator

import coal
import numpy as np
import pinocchio as pin

from planner.robot.robot import Robot

RADIUS_M = 1e-3


def link_lines(robot: Robot) -> list[pin.GeometryObject]:
    """Thin rods from joint to joint and to the tool's tip, each on the link that carries it.

    They begin where a turning joint has carried them away from what the robot stands on: the
    origin of the first is on the floor or in it, and rails lie there. A slide's way is left out:
    how far the link reaches along it depends on where it stands.
    """
    model, found = robot.model, []
    for number in range(1, model.njoints):
        frame = model.getFrameId(robot.body_frames(number)[0].name, pin.FrameType.BODY)
        for place, (a, b) in enumerate(_lines(robot, number)):
            name = f"{model.names[number]}_line_{place}"
            found.append(pin.GeometryObject(name, number, frame, *_rod(a, b)))
    return found


def _lines(robot: Robot, number: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Ends (3,) of a body's lines in the frame of its joint; of the tip alone at least a point."""
    model, slides = robot.model, robot.linkage.slides
    tcp, start = model.frames[robot.tcp_id], np.zeros(3)
    carried = any(not slides[k - 1] for k in model.supports[number] if 0 < k != number)
    for k in model.children[number]:
        if carried and not slides[k - 1]:
            yield start, model.jointPlacements[k].translation
    if tcp.parentJoint == number:
        tip = tcp.placement.translation
        yield (start if carried else tip), tip


def _rod(a: np.ndarray, b: np.ndarray) -> tuple[pin.SE3, coal.CollisionGeometry]:
    """A rod from a to b (3,), where it is and what it is."""
    length = float(np.linalg.norm(b - a))
    if length < RADIUS_M:
        return pin.SE3(np.eye(3), np.array(b)), coal.Sphere(RADIUS_M)
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), (b - a) / length)
    return pin.SE3(turn.toRotationMatrix(), (a + b) / 2), coal.Capsule(RADIUS_M, length)
