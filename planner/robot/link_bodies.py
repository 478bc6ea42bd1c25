"""What a URDF says of each link: its mass, how it is spread, and how large the link is."""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from planner.robot.link_inertias import link_inertia
from planner.robot.robot import Robot
from planner.robot.shapes import shape_corners


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
