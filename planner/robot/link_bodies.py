"""What a URDF says of each link; the robot at a pose as lines, boxes and frames, for drawings."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from planner.robot.robot import Robot
from planner.robot.shapes import leave_out_unreadable, shape_corners
from planner.robot.urdf_elements import link_inertia, placed, vector


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
    links, joints = robot.links, ElementTree.fromstring(robot.urdf_text).findall("joint")
    left = (*robot.left_out, *leave_out_unreadable(links))
    shapes, tables = shape_corners(links), {table.link: table for table in robot.config.link}
    names, lacking = ("", *robot.linkage.names), {one.link for one in left}
    found = []
    for name, link in links.items():
        joint = names[robot.model.frames[robot.frame_id("link", name)].parentJoint]
        inertia = link_inertia(link)
        carried = (j for j in joints if any(p.get("link") == name for p in j.findall("parent")))
        ends = [vector(j, "origin", "xyz") for j in carried]
        corners = np.array([*shapes.get(name, []), *ends, np.zeros(3)])
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
    corners = shape_corners(robot.links)
    moved = [body.name for body in link_bodies(robot) if body.joint in joints]
    stand = placements(robot, q, [robot.frame_id("link", name) for name in moved])
    each = zip(moved, *stand, strict=True)
    heights = (turn[2] @ v + place[2] for name, turn, place in each for v in corners[name])
    return float(min(heights, default=np.inf))


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
    model, tcp, found = robot.model, robot.model.frames[robot.tcp_id], []
    for number in range(model.njoints):
        ends = [end for k in model.children[number] for end in _ends(robot, int(k))]
        ends += [tcp.placement.translation] if tcp.parentJoint == number else []
        apart = [np.array(end) for end in ends if np.linalg.norm(end) > APART_M]
        links = tuple(frame.name for frame in robot.body_frames(number))
        found.append(BodyShape(links[0], links, np.array(apart or [np.zeros(3)])))
    return tuple(found)


def _ends(robot: Robot, joint: int) -> list[np.ndarray]:
    """Where a joint is on what carries it, (3,) each: of one that slides, both ends of its way."""
    place = robot.model.jointPlacements[joint]
    linkage, own = robot.linkage, joint - 1
    if not linkage.slides[own]:
        return [place.translation]
    way = linkage.at(robot.lower_rad)[own], linkage.at(robot.upper_rad)[own]
    return [place.translation + place.rotation @ (v * linkage.axes[own]) for v in way]


def mounted(robot: Robot, links: tuple[LinkBody, ...]) -> tuple[LinkBody, ...]:
    """Links with a mass fixed to what the last joint carries: the tool, where the URDF has it."""
    number = robot.model.frames[robot.tcp_id].parentJoint
    last = ("", *robot.linkage.names)[number]
    return tuple(b for b in links if last and b.joint == last and not b.first and b.mass > 0)


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
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.linkage.at(q))

    def place_of(name: str) -> pin.SE3:
        return data.oMf[robot.frame_id("link", name)]

    lines = [
        (data.oMi[number].translation.copy(), data.oMi[number].act(np.asarray(end)))
        for number, body in enumerate(bodies(robot))
        for end in body.ends_m
        if np.any(end)
    ]
    stand = zip(robot.joint_names, robot.joint_places(q), strict=True)
    named = {robot.config.tcp_frame: robot.tcp_id, robot.config.sensor_frame: robot.sensor_id}
    rotations, places = placements(robot, q, list(named.values()))
    masses = [(b.mass, place_of(b.name).act(b.com_m)) for b in links if b.joint and b.mass > 0]
    shapes = [
        np.array([place_of(name).act(corner) for corner in box])
        for name, corners in shape_corners(robot.links).items()
        for box in np.array(corners).reshape(-1, 8, 3)
    ]
    joints = [(name, *place) for name, place in stand]
    frames = list(zip(named, places, rotations, strict=True))
    signs, obstacles = np.array(list(np.ndindex(2, 2, 2))) - 0.5, []
    for block in robot.config.obstacle:
        at = placed(block.center_m, block.rpy_deg)
        obstacles.append(np.array([at.act(corner) for corner in signs * block.size_m]))
    return RobotLines(lines, joints, frames, masses, shapes, obstacles)
