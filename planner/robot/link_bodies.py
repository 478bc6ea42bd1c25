"""What a URDF says of each link: its mass, how it is spread, and how large the link is."""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from planner.robot.robot import Robot
from planner.robot.urdf_inertias import link_inertia


@dataclass(frozen=True, eq=False)
class LinkBody:
    """One link of the URDF.

    `joint` turns it ("" for what stands still). Mass in kg, `com_m` (3,) in the link's frame,
    `moments` (3,) principal moments in kg·m² about it, increasing. `size_m` is the diagonal of a
    box around its shapes and what it carries, 0 where it has neither; `shapes` and `visuals` count
    its collision and visual shapes. `low_m` and `high_m` (3,) are the corners of that box.
    """

    name: str
    joint: str
    first: bool  # whether the joint carries it directly
    stated: bool  # whether it has an <inertial>
    mass: float
    com_m: np.ndarray
    moments: np.ndarray
    low_m: np.ndarray
    high_m: np.ndarray
    shapes: int
    visuals: int

    @property
    def size_m(self) -> float:
        """Diagonal of the box around the link's shapes and what it carries."""
        return float(np.linalg.norm(self.high_m - self.low_m))


def link_bodies(robot: Robot) -> tuple[LinkBody, ...]:
    """All links of the URDF in its order."""
    root = ElementTree.fromstring(robot.urdf_text)
    shapes = shape_corners(root)
    names = ("", *robot.linkage.names)
    found = []
    for link in root.findall("link"):
        name = link.get("name", "")
        if not robot.model.existFrame(name, pin.FrameType.BODY):
            continue
        frame = robot.model.frames[robot.model.getFrameId(name, pin.FrameType.BODY)]
        joint = names[frame.parentJoint]
        inertia = link_inertia(link) if link.find("inertial") is not None else pin.Inertia.Zero()
        corners = np.array([*shapes.get(name, []), *_carried(root, name), np.zeros(3)])
        found.append(
            LinkBody(
                name=name,
                joint=joint,
                first=bool(joint) and robot.link_of(joint) == name,
                stated=link.find("inertial") is not None,
                mass=float(inertia.mass),
                com_m=np.array(inertia.lever),
                moments=np.linalg.eigvalsh(inertia.inertia),
                low_m=corners.min(axis=0),
                high_m=corners.max(axis=0),
                shapes=len(link.findall("collision")),
                visuals=len(link.findall("visual")),
            )
        )
    return tuple(found)


def _carried(root: ElementTree.Element, link: str) -> list[np.ndarray]:
    """Origins of the joints that a link carries, in its frame."""
    found = []
    for joint in root.findall("joint"):
        parent, origin = joint.find("parent"), joint.find("origin")
        if parent is not None and parent.get("link") == link and origin is not None:
            found.append(np.array([float(v) for v in origin.get("xyz", "0 0 0").split()]))
    return found


def shape_corners(root: ElementTree.Element) -> dict[str, list[np.ndarray]]:
    """Corners (3,) of boxes around the primitive shapes of each link, in its frame, eight each.

    Collision shapes; visual ones where a link has no others.
    """
    found: dict[str, list[np.ndarray]] = {}
    for link in root.findall("link"):
        corners = found.setdefault(link.get("name", ""), [])
        for part in link.findall("collision") or link.findall("visual"):
            half = _half_size(part)
            if half is not None:
                rotation, place = _origin(part)
                for signs in np.ndindex(2, 2, 2):
                    corners.append(place + rotation @ (half * (2 * np.array(signs) - 1)))
    return found


def _half_size(part: ElementTree.Element) -> np.ndarray | None:
    """Half edges (3,) of the box around a box, cylinder or sphere; None for a mesh."""
    box, rod = part.find("geometry/box"), part.find("geometry/cylinder")
    ball = part.find("geometry/sphere")
    if box is not None:
        return np.array([float(v) for v in box.get("size", "0 0 0").split()]) / 2
    if rod is not None:
        radius = float(rod.get("radius", "0"))
        return np.array([radius, radius, float(rod.get("length", "0")) / 2])
    return None if ball is None else np.full(3, float(ball.get("radius", "0")))


def _origin(part: ElementTree.Element) -> tuple[np.ndarray, np.ndarray]:
    origin = part.find("origin")
    if origin is None:
        return np.eye(3), np.zeros(3)
    rpy = np.array([float(v) for v in origin.get("rpy", "0 0 0").split()])
    place = np.array([float(v) for v in origin.get("xyz", "0 0 0").split()])
    return pin.rpy.rpyToMatrix(rpy), place
