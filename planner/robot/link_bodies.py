"""What a URDF says of each link: its mass, how it is spread, and how large the link is."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from planner.robot.robot import Robot
from planner.robot.shapes import leave_out_unreadable, shape_corners
from planner.robot.urdf_elements import link_inertia, vector


@dataclass(frozen=True, eq=False)
class LinkBody:
    """One link of the URDF.

    `joint` turns it ("" for what stands still). Mass in kg, `com_m` (3,) in the link's frame,
    `moments` (3,) principal moments in kg·m² about it, increasing. `size_m` is the diagonal of a
    box around its shapes and what it carries, 0 where it has neither; `shapes` and `visuals` count
    its collision and visual shapes. `low_m` and `high_m` (3,) are the corners of that box, `whole`
    is whether it is known: there is a shape, and none is missing. `sd_percent` is how sure
    robot.toml says its mass is, `guessed` that it is a guess.
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
    whole: bool = True
    sd_percent: float | None = None
    guessed: bool = False

    @property
    def size_m(self) -> float:
        """Diagonal of the box around the link's shapes and what it carries."""
        return float(np.linalg.norm(self.high_m - self.low_m))


def link_bodies(robot: Robot) -> tuple[LinkBody, ...]:
    """All links of the URDF in its order."""
    root = ElementTree.fromstring(robot.urdf_text)
    left = (*robot.left_out, *leave_out_unreadable(root))
    shapes, tables = shape_corners(root), {table.link: table for table in robot.config.link}
    names, lacking = ("", *robot.linkage.names), {one.link for one in left}
    found = []
    for link in root.findall("link"):
        name = link.get("name", "")
        if not robot.model.existFrame(name, pin.FrameType.BODY):
            continue
        frame = robot.model.frames[robot.model.getFrameId(name, pin.FrameType.BODY)]
        joint = names[frame.parentJoint]
        inertia = link_inertia(link)
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
                whole=bool(shapes.get(name)) and name not in lacking,
                sd_percent=tables[name].sd_percent if name in tables else None,
                guessed=name in tables and tables[name].guessed,
            )
        )
    return tuple(found)


def guessed_masses(links: Sequence[LinkBody]) -> str:
    """Which masses are guesses, in a sentence; "" where none is."""
    guessed = [link for link in links if link.guessed and link.mass > 0]
    if not guessed:
        return ""
    percent = max(link.sd_percent or 0.0 for link in guessed)
    within = f", each with an sd of {percent:g} %" if percent else ""
    named = ", ".join(link.name for link in guessed)
    return f"Masses are guessed{within}: {named}."


def lowest_m(robot: Robot, q: np.ndarray, joints: Sequence[str]) -> float:
    """How low in the world anything is at q (dof,) that these joints move directly; inf: none."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.linkage.at(q))
    corners = shape_corners(ElementTree.fromstring(robot.urdf_text))
    found = [np.inf]
    for body in link_bodies(robot):
        place = data.oMf[robot.model.getFrameId(body.name, pin.FrameType.BODY)]
        if body.joint in joints:
            found += [float(place.act(corner)[2]) for corner in corners[body.name]]
    return min(found)


def _carried(root: ElementTree.Element, link: str) -> list[np.ndarray]:
    """Origins of the joints that a link carries, in its frame."""
    carried = (joint for joint in root.findall("joint") if joint.find("origin") is not None)
    return [
        vector(joint, "origin", "xyz")
        for joint in carried
        if (parent := joint.find("parent")) is not None and parent.get("link") == link
    ]
