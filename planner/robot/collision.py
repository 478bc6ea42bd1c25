"""Joint limits, self-collision and obstacles of a pose."""

from collections.abc import Iterator
from functools import cached_property, lru_cache
from itertools import combinations

import coal
import numpy as np
import pinocchio as pin

from planner.errors import InputError
from planner.robot.robot import Robot
from planner.robot.shapes import (
    UnusableShape,
    build_geometry,
    leave_out_unreadable,
    unchecked_sentence,
)
from planner.robot.urdf_elements import placed

LIMIT_TOLERANCE = 1e-9  # rad or m
NAMED = 3  # obstacles in a sentence
RADIUS_M = 1e-3  # of lines that stand for links
KEPT = 4  # robots whose collision shapes are at hand


class Collisions:
    """Says what keeps a robot from standing at a pose.

    Checked are all pairs of links except neighbours (shapes at a joint overlap by design), links
    that touch in the middle of all joints' ranges (there, far from all limits, a robot stands free:
    it is coarse shapes that overlap), and those that robot.toml's [collision] ignores; and every
    moving link against every [[obstacle]]. An obstacle that is touched there stays in: it is the
    obstacle that is wrong, and only the engineer can tell. Against obstacles a line from the last
    joint to the tip stands for the tool, and where the URDF has no shapes lines from joint to joint
    for the links. Raises InputError where [collision] names
    what does not exist.
    """

    def __init__(self, robot: Robot):
        self.robot = robot
        obstacles = {block.name for block in robot.config.obstacle}
        links = {str(f.name) for f in robot.model.frames if f.type == pin.FrameType.BODY}
        for name in sorted(obstacles & links):
            raise InputError(
                f'{robot.path}: [[obstacle]] "{name}" has the name of a link of '
                f"{robot.urdf_path.name}; rename it."
            )
        for name in (name for pair in robot.config.collision.ignore for name in pair):
            if name not in obstacles | links:
                raise InputError(
                    f'{robot.path}: [collision] ignore names "{name}", which is neither a '
                    f"link of {robot.urdf_path.name} nor an [[obstacle]]; correct it."
                )

    @property
    def unchecked(self) -> str | None:
        """A sentence where collision geometry is missing, so that little or nothing is checked."""
        left = unchecked_sentence(self.left_out)
        if not self.none_checked:
            return left or None
        bare = f"{self.robot.urdf_path.name} has no collision geometry"
        look = "Look at each pose before the robot moves there."
        if not self.nothing_checked:
            names, file = [b.name for b in self.robot.config.obstacle], self.robot.path.name
            obstacles = f"the obstacles of {file} ({', '.join(names)})"
            if len(names) > NAMED:
                obstacles = f"all {len(names)} obstacles of {file}"
            return (
                f"{left or f'{bare}.'} Instead, thin lines from joint to joint, up to the tool's "
                f"tip, are checked against {obstacles}: links are thicker, and may touch each "
                f"other. {look}"
            )
        if left:
            return f"Nothing is checked for collision: {left} {look}"
        return f"Nothing is checked for collision, because {bare}. {look}"

    @property
    def overlapping(self) -> tuple[str, ...]:
        """Pairs of links whose shapes overlap and are not checked, one phrase each."""
        return self._geometry[3]

    @property
    def left_out(self) -> tuple[UnusableShape, ...]:
        """Shapes of the URDF that cannot be used."""
        return _link_geometry(self.robot)[1]

    @property
    def none_checked(self) -> bool:
        """Whether no link has a shape that can be checked."""
        return not _link_geometry(self.robot)[0].ngeoms

    @property
    def nothing_checked(self) -> bool:
        """Whether nothing keeps a robot from a pose but its limits."""
        return self.none_checked and not self.robot.config.obstacle

    @cached_property
    def _geometry(self) -> tuple[pin.GeometryModel, pin.GeometryData, pin.Data, tuple[str, ...]]:
        geometry, overlapping = _with_pairs(self.robot)
        return geometry, self._data(geometry), self.robot.model.createData(), overlapping

    def with_pairs(self) -> tuple[pin.GeometryModel, tuple[str, ...]]:
        """Shapes with the pairs to check, and which pairs of links overlap."""
        robot = self.robot
        geometry = _link_geometry(robot)[0].copy()
        links = list(range(geometry.ngeoms))
        for i, j in combinations(links, 2):
            a, b = (geometry.geometryObjects[k].parentJoint for k in (i, j))
            near = a == b or robot.model.parents[a] == b or robot.model.parents[b] == a
            if not near and not self._ignored(geometry, i, j):
                geometry.addCollisionPair(pin.CollisionPair(i, j))
        overlapping = self._drop_overlapping(geometry)
        lines = _link_lines(robot, of_tool_alone=bool(links))
        links += [geometry.addGeometryObject(obj) for obj in lines]
        for box in [geometry.addGeometryObject(obj) for obj in _obstacles(robot)]:
            for i in links:
                moves = geometry.geometryObjects[i].parentJoint > 0
                if moves and not self._ignored(geometry, i, box):
                    geometry.addCollisionPair(pin.CollisionPair(i, box))
        return geometry, overlapping

    def _data(self, geometry: pin.GeometryModel) -> pin.GeometryData:
        data = geometry.createData()
        for request in data.collisionRequests:
            request.security_margin = self.robot.config.collision.margin_m
        return data

    def _name(self, geometry: pin.GeometryModel, index: int) -> str:
        """Link or obstacle that a shape belongs to."""
        shape = geometry.geometryObjects[index]
        if shape.parentFrame >= self.robot.model.nframes:  # obstacles belong to no frame
            return shape.name
        return str(self.robot.model.frames[shape.parentFrame].name)

    def _ignored(self, geometry: pin.GeometryModel, i: int, j: int) -> bool:
        names = {self._name(geometry, i), self._name(geometry, j)}
        return any(names == set(pair) for pair in self.robot.config.collision.ignore)

    def _drop_overlapping(self, geometry: pin.GeometryModel) -> tuple[str, ...]:
        """Remove pairs of links that touch in the middle of all ranges; names them."""
        if not len(geometry.collisionPairs):
            return ()
        robot, data = self.robot, self._data(geometry)
        middle = robot.linkage.at(robot.middle_rad)
        pin.computeCollisions(robot.model, robot.model.createData(), geometry, data, middle, False)
        # Numbers: the model's own list moves up under its elements when one of them is removed.
        pairs = [(pair.first, pair.second) for pair in geometry.collisionPairs]
        touching = zip(pairs, list(data.collisionResults), strict=True)
        dropped = [pair for pair, result in touching if result.isCollision()]
        for i, j in dropped:
            geometry.removeCollisionPair(pin.CollisionPair(i, j))
        names = [(self._name(geometry, i), self._name(geometry, j)) for i, j in dropped]
        return tuple(dict.fromkeys(" touches ".join(pair) for pair in names))

    def limits(self, q: np.ndarray) -> tuple[str, ...]:
        """Violated joint limits, one phrase each."""
        robot, found = self.robot, []
        joints, given = robot.joints, robot.joints.shown(q)
        for i, (name, value, low, high) in enumerate(
            zip(robot.joint_names, q, robot.lower_rad, robot.upper_rad, strict=True)
        ):
            if np.isnan(value):
                found.append(f"{name} has no {'place' if joints.slides[i] else 'angle'}")
            elif not low - LIMIT_TOLERANCE <= value <= high + LIMIT_TOLERANCE:
                below = value < low
                limit = joints.shown(robot.lower_rad if below else robot.upper_rad)[i]
                found.append(
                    f"{name} at {joints.text(i, given[i])} is {'below' if below else 'above'} its "
                    f"limit of {joints.text(i, limit)}"
                )
        return tuple(found)

    def contacts(self, q: np.ndarray) -> tuple[str, ...]:
        """Pairs in contact (closer than margin_m) at finite q (dof,), one phrase each."""
        geometry, data, kinematics, _ = self._geometry
        if not len(geometry.collisionPairs):
            return ()
        x = self.robot.linkage.at(q)
        pin.computeCollisions(self.robot.model, kinematics, geometry, data, x, False)
        found = []
        for pair, result in zip(geometry.collisionPairs, data.collisionResults, strict=True):
            if result.isCollision():
                names = self._name(geometry, pair.first), self._name(geometry, pair.second)
                found.append(" touches ".join(names))
        return tuple(dict.fromkeys(found))

    def free(self, q: np.ndarray) -> bool:
        """Whether the pose is within limits and touches nothing (stops at the first contact)."""
        if self.limits(q):
            return False
        geometry, data, kinematics, _ = self._geometry
        if not len(geometry.collisionPairs):
            return True
        x = self.robot.linkage.at(q)
        return not pin.computeCollisions(self.robot.model, kinematics, geometry, data, x, True)

    def violations(self, q: np.ndarray) -> tuple[str, ...]:
        """All that is wrong with a pose (dof,), limits first; empty when it is free."""
        limits = self.limits(q)
        return limits + self.contacts(q) if np.all(np.isfinite(q)) else limits


@lru_cache(maxsize=KEPT)
def _with_pairs(robot: Robot) -> tuple[pin.GeometryModel, tuple[str, ...]]:
    return Collisions(robot).with_pairs()


@lru_cache(maxsize=KEPT)
def _link_geometry(robot: Robot) -> tuple[pin.GeometryModel, tuple[UnusableShape, ...]]:
    """Collision shapes of the links, and those of the URDF that are left out."""
    links = robot.links
    left = (*robot.left_out, *leave_out_unreadable(links))
    return build_geometry(robot.model, links), left


def _obstacles(robot: Robot) -> list[pin.GeometryObject]:
    made = []
    for block in robot.config.obstacle:
        at = placed(block.center_m, block.rpy_deg)
        made.append(pin.GeometryObject(block.name, 0, at, coal.Box(*block.size_m)))
    return made


def _link_lines(robot: Robot, of_tool_alone: bool) -> list[pin.GeometryObject]:
    """Thin rods from joint to joint and to the tool's tip, each on the link that carries it.

    They begin where a turning joint has carried them away from what the robot stands on: the
    origin of the first is on the floor or in it, and rails lie there. A slide's way is left out:
    how far the link reaches along it depends on where it stands.
    """
    model, found = robot.model, []
    for number in range(1, model.njoints):
        frame = robot.frame_id("link", robot.body_frames(number)[0].name)
        for place, (a, b) in enumerate(_lines(robot, number, of_tool_alone)):
            name = f"{model.names[number]}_line_{place}"
            found.append(pin.GeometryObject(name, number, frame, *_rod(a, b)))
    return found


def _lines(
    robot: Robot, number: int, of_tool_alone: bool
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Ends (3,) of a body's lines in the frame of its joint; of the tip alone at least a point."""
    model, slides = robot.model, robot.linkage.slides
    tcp, start = model.frames[robot.tcp_id], np.zeros(3)
    carried = any(not slides[k - 1] for k in model.supports[number] if 0 < k != number)
    for k in model.children[number]:
        if carried and not (of_tool_alone or slides[k - 1]):
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
