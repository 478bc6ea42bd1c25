"""A robot: kinematics and limits from its URDF, the elastic part from robot.toml."""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pinocchio as pin

from planner.errors import InputError
from planner.recording.joints import JointUnits
from planner.recording.points import AXES, SENSOR, TCP, Layout, PointNames
from planner.robot.config import Compliance, RobotConfig
from planner.robot.config_file import (
    check_entries,
    check_laws,
    check_own_springs,
    controller_axes,
    load_config,
)
from planner.robot.shapes import UnusableShape, leave_out_unusable
from planner.robot.urdf import build_model, read_urdf
from planner.robot.urdf_elements import Links, links_of, placed, state_inertias
from planner.robot.urdf_joints import Linkage

PREFIX = "point "  # of the names of points' frames: a point may be called like a link
SAME_M, SAME_RAD = 1e-6, 1e-6  # two frames are one: as exactly as files state places
LEVER_M = 0.3  # half the length of a carriage, chosen
# A link and the joint that carries it may share a name; the link is meant.
FRAME_TYPES = (
    pin.FrameType.BODY,
    pin.FrameType.FIXED_JOINT,
    pin.FrameType.JOINT,
    pin.FrameType.OP_FRAME,
)


@dataclass(frozen=True, eq=False)
class Robot:
    """Immutable; angles in rad, lengths in m, joints in the URDF's actuated order.

    Joints that follow others (<mimic>) are none of them: only `model` and `linkage` have them too.
    Joint coordinates q are in rad, of joints that slide in m; `joints` converts them from and to
    the degrees and millimetres of files and answers.
    """

    config: RobotConfig
    path: Path  # robot.toml
    urdf_path: Path
    urdf_text: str  # as it is used: limits for continuous joints, meshes named in full
    model: pin.Model
    linkage: Linkage
    joints: JointUnits
    lower_rad: np.ndarray  # limits of the joints (dof,) in rad, of those that slide in m
    upper_rad: np.ndarray
    velocity_rad_s: np.ndarray  # their speeds (dof,)
    left_out: tuple[UnusableShape, ...] = ()  # shapes of the URDF that cannot be used

    def __repr__(self) -> str:
        joints, springs = len(self.joints.names), len(self.config.compliance)
        return (
            f"Robot({self.config.name!r}: {joints} joints, {springs} springs, {str(self.path)!r})"
        )

    @classmethod
    def load(cls, robot_toml: Path | str) -> "Robot":
        """Read robot.toml and its URDF. Raises InputError naming file, entry and remedy."""
        return cls.of(load_config(Path(robot_toml)), Path(robot_toml))

    @classmethod
    def of(cls, config: RobotConfig, robot_toml: Path) -> "Robot":
        """Of what robot.toml says, or would say if it stood there."""
        try:
            urdf = (robot_toml.parent / config.urdf).resolve()
        except (OSError, ValueError) as error:  # a name that no file can have
            raise InputError(
                f"{robot_toml}: its URDF {config.urdf!r} cannot be read ({error}); correct the "
                f"entry urdf."
            ) from None
        root = read_urdf(urdf, robot_toml, config.held)
        left_out = leave_out_unusable(links_of(root), urdf)
        state_inertias(links_of(root), config.link)
        text = ElementTree.tostring(root, encoding="unicode")
        model = build_model(text, urdf)
        linkage = Linkage.of(root, tuple(model.names)[1:])
        joints = JointUnits(linkage.leading(linkage.names), linkage.leading(linkage.slides))
        axes = controller_axes(config.controller, joints, robot_toml)
        joints = replace(joints, axes=tuple(axes[name] for name in joints.names))
        ranges = model.lowerPositionLimit, model.upperPositionLimit, model.velocityLimit
        low, high, speed = (np.array(values)[list(linkage.leads)] for values in ranges)
        robot = cls(
            config, robot_toml, urdf, text, model, linkage, joints, low, high, speed, left_out
        )
        robot._add_points()
        check_entries(robot)
        check_own_springs(robot)
        check_laws(robot)
        _ = robot.points
        return robot

    def _add_points(self) -> None:
        """Frames of the model at the points of robot.toml."""
        for point in self.config.point:
            if not point.link and point.name in (TCP, SENSOR):
                number = self.tcp_id if point.name == TCP else self.sensor_id
            else:
                number = self.frame_id(f"[[point]] {point.name}: link", point.link)
            frame, name = self.model.frames[number], PREFIX + point.name
            place = frame.placement * placed(point.position_m, point.rpy_deg)
            added = pin.Frame(name, frame.parentJoint, number, place, pin.FrameType.OP_FRAME)
            self.model.addFrame(added)

    @property
    def links(self) -> Links:
        """Elements of the URDF's links, as it is used; new ones each time."""
        return links_of(ElementTree.fromstring(self.urdf_text))

    @property
    def name(self) -> str:
        """Name in robot.toml."""
        return self.config.name

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Actuated joints in order."""
        return self.joints.names

    @cached_property
    def joint_axes(self) -> tuple[np.ndarray, ...]:
        """Unit vectors (3,) of the actuated joints in their own frames."""
        return self.linkage.leading(self.linkage.axes)

    def link_of(self, joint: str) -> str:
        """The link that a joint moves, of all joints; KeyError if there is no such joint."""
        frames = self.body_frames((None, *self.linkage.names).index(joint))
        if not frames:
            raise KeyError(joint)
        return frames[0].name

    def body_frames(self, joint: int) -> list[pin.Frame]:
        """Frames of the links that a joint carries, by Pinocchio's number; 0: the base."""
        bodies = (f for f in self.model.frames if f.type == pin.FrameType.BODY)
        return [frame for frame in bodies if frame.parentJoint == joint]

    def slides(self, joint: str) -> bool:
        """Whether a joint slides along its axis."""
        return self.joints.slides[self.joint_names.index(joint)]

    def is_own(self, block: Compliance) -> bool:
        """Whether an elastic degree of freedom is its joint's own: about its axis, or along it."""
        if block.joint not in self.joint_names:
            return False
        joint = self.joint_names.index(block.joint)
        along = abs(np.array(block.axis) @ self.joint_axes[joint]) > 0.9
        return bool(along) and block.slide == self.slides(block.joint)

    def slides_along(self, block: Compliance) -> bool:
        """Whether an elastic degree of freedom is a shift of a joint that slides."""
        return block.slide and block.joint in self.joint_names and self.slides(block.joint)

    def turning_stiffness(self) -> tuple[float, ...]:
        """Stated stiffnesses (N·m/rad) of rotations; without any, of slides at LEVER_M."""
        turning = [b.stiffness for b in self.config.compliance if not b.slide]
        return tuple(turning or [b.stiffness * LEVER_M**2 for b in self.config.compliance])

    def carries(self, link: str) -> tuple[int, int] | None:
        """Numbers of the joint that moves a link and of the one that it carries, if it does."""
        for joint, name in enumerate(self.linkage.names, 1):
            if self.link_of(name) == link:
                beyond = [int(k) for k in self.model.children[joint]]
                beyond.sort(key=lambda k: k - 1 not in self.linkage.leads)  # balancers come last
                return (joint, beyond[0]) if beyond else None
        return None

    @cached_property
    def middle_rad(self) -> np.ndarray:
        """The middle (dof,) of all ranges in rad, of joints that slide in m."""
        return (self.lower_rad + self.upper_rad) / 2

    @cached_property
    def _data(self) -> pin.Data:
        return self.model.createData()

    @cached_property
    def tcp_id(self) -> int:
        """Pinocchio's frame number of the tcp."""
        return self.place_id("tcp_frame", self.config.tcp_frame)

    @cached_property
    def sensor_id(self) -> int:
        """Pinocchio's frame number of the sensor."""
        return self.place_id("sensor_frame", self.config.sensor_frame)

    @property
    def sensor_at_tcp(self) -> bool:
        """Whether the sensor is where the tool is hit, its axes parallel to the tcp's."""
        return self._is_one_place(self.tcp_id, self.sensor_id)

    def _is_one_place(self, one: int, other: int) -> bool:
        """Whether two frames, by their numbers, are one."""
        a, b = self.model.frames[one], self.model.frames[other]
        off = a.placement.actInv(b.placement)
        turned = float(np.linalg.norm(pin.log3(off.rotation)))
        near = float(np.linalg.norm(off.translation)) < SAME_M and turned < SAME_RAD
        return near and a.parentJoint == b.parentJoint

    def place_id(self, entry: str, name: str) -> int:
        """Number of a frame of the URDF, or of a [[point]] that lies in one of its links."""
        point = any(p.name == name and p.link for p in self.config.point)
        point = point and not any(self.model.existFrame(name, kind) for kind in FRAME_TYPES)
        return self.frame_id(entry, PREFIX + name if point else name)

    @cached_property
    def points(self) -> PointNames:
        """What recordings may call the points of robot.toml, and that they may say nothing.

        InputError where one is called like the tool's and lies elsewhere.
        """
        tools, points = {TCP: self.tcp_id, SENSOR: self.sensor_id}, self.config.point
        place = {p.name: self.frame_id("[[point]]", PREFIX + p.name) for p in points}
        for name, there in tools.items():
            if not self._is_one_place(place.setdefault(name, there), there):
                raise InputError(
                    f'{self.path}: [[point]] "{name}" is not where robot.toml\'s {name}_frame is: '
                    f'state {name}_frame = "{name}" to put that there, or leave out its link and '
                    f"place."
                )
        at_tcp, at_sensor = (
            tuple(name for name, own in place.items() if self._is_one_place(own, there))
            for there in tools.values()
        )
        axes: dict[str, str] = {p.name: "".join(a for a in AXES if a in p.axes) for p in points}
        nodes = {str(p.node): p.name for p in points if p.node is not None}
        return PointNames(axes, nodes, at_tcp, at_sensor)

    def layout_ids(self, layout: Layout) -> tuple[list[int], list[int]]:
        """Pinocchio's frame numbers of a layout's hit points and of its sensors."""
        ids = {p.name: self.frame_id("[[point]]", PREFIX + p.name) for p in self.config.point}
        ids |= {TCP: self.tcp_id, SENSOR: self.sensor_id}  # where points of these names are, too
        return [ids[n] for n in layout.hits], [ids[n] for n in layout.sensors]

    @cached_property
    def sensor_mass_kg(self) -> dict[str, float]:
        """Masses of sensors that are not 0, by what layouts call their points."""
        return {self.points.sensor(p.name): p.mass_kg for p in self.config.point if p.mass_kg > 0}

    def frame_id(self, entry: str, name: str) -> int:
        """Pinocchio's number of a frame that robot.toml names at `entry`; InputError if none."""
        for kind in FRAME_TYPES:
            if name != "universe" and self.model.existFrame(name, kind):
                return self.model.getFrameId(name, kind)
        raise InputError(
            f'{self.path}: {entry} "{name}" is no frame of {self.urdf_path.name}; '
            f"add it there as a link on a fixed joint, or correct the name."
        )

    @cached_property
    def tool_chain(self) -> tuple[int, ...]:
        """Places in `linkage` of all joints between the base and the tcp, from the tcp."""
        chain = list(self.model.supports[self.model.frames[self.tcp_id].parentJoint])
        return tuple(int(joint) - 1 for joint in reversed(chain) if joint)

    @cached_property
    def shoulder_m(self) -> np.ndarray:
        """Where the first joint of the tcp's chain stands in the world (3,)."""
        return np.array(self.model.jointPlacements[self.tool_chain[-1] + 1].translation)

    @cached_property
    def reach_m(self) -> float:
        """No pose brings the tcp farther from the shoulder than this (arm pulled straight)."""
        ends = np.abs([self.linkage.at(self.lower_rad), self.linkage.at(self.upper_rad)])
        slides = [k for k in self.tool_chain if self.linkage.slides[k]]
        return self.arm_m + float(np.sum(ends.max(axis=0)[slides]))

    @cached_property
    def tool_joints(self) -> tuple[int, ...]:
        """Places in q of the joints that move the tcp."""
        moved = self.linkage.spread[list(self.tool_chain)]
        return tuple(int(k) for k in np.flatnonzero(np.any(moved != 0, axis=0)))

    @cached_property
    def arm_m(self) -> float:
        """Length of the arm pulled straight, joints that slide at their zeros."""
        return self.beyond_m(0)

    def beyond_m(self, joint: int) -> float:
        """That of what lies beyond a joint, by Pinocchio's number, towards the tcp."""
        numbers = (k + 1 for k in self.tool_chain[:-1])
        places = [self.model.jointPlacements[k] for k in numbers if k > joint]
        places.append(self.model.frames[self.tcp_id].placement)
        return float(sum(np.linalg.norm(place.translation) for place in places))

    def placement(self, q: np.ndarray) -> pin.SE3:
        """Where the tcp is in the world at q (dof,); good until the next call."""
        pin.framesForwardKinematics(self.model, self._data, self.linkage.at(q))
        return self._data.oMf[self.tcp_id]

    def forward(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (3, 3) and position (3,) of the tcp in the world at q (dof,)."""
        placement = self.placement(q)
        return placement.rotation.copy(), placement.translation.copy()

    def joint_places(self, q: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Of each joint of q: place (3,) and axis (3,) in the world at q (dof,)."""
        pin.forwardKinematics(self.model, self._data, self.linkage.at(q))
        places = zip(self.joint_axes, self.linkage.leading(list(self._data.oMi)[1:]), strict=True)
        return [(place.translation.copy(), place.rotation @ axis) for axis, place in places]

    def forward_batch(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rotations (n, 3, 3) and positions (n, 3) of the tcp at q (n, dof)."""
        both = [self.forward(row) for row in np.atleast_2d(q)]
        rotation = np.array([r for r, _ in both]).reshape(-1, 3, 3)
        return rotation, np.array([p for _, p in both]).reshape(-1, 3)

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Jacobian (6, dof) of the tcp in its own frame, linear part first."""
        of_all = pin.computeFrameJacobian(
            self.model, self._data, self.linkage.at(q), self.tcp_id, pin.LOCAL
        )
        return of_all @ self.linkage.spread
