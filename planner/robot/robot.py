"""A robot: kinematics and limits from its URDF, the elastic part from robot.toml."""

import os
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pinocchio as pin

from planner.errors import InputError
from planner.robot.config import RobotConfig, load_config

FIXED, TURNING = ("fixed",), ("revolute", "continuous")


@dataclass(frozen=True, eq=False)
class Robot:
    """Immutable; angles in rad, lengths in m, joints in the URDF's actuated order."""

    config: RobotConfig
    path: Path  # robot.toml
    urdf_path: Path
    urdf_text: str  # with continuous joints given limits of ±180°
    model: pin.Model
    joint_axes: tuple[np.ndarray, ...]  # unit vectors in the joints' own frames

    @classmethod
    def load(cls, robot_toml: Path) -> "Robot":
        """Read robot.toml and its URDF. Raises InputError naming file, entry and remedy."""
        config = load_config(robot_toml)
        urdf = (robot_toml.parent / config.urdf).resolve()
        root = _parse(urdf, robot_toml)
        axes = _axes(root, urdf)
        text = ElementTree.tostring(root, encoding="unicode")
        with silenced():
            try:
                model = pin.buildModelFromXML(text)
            except Exception as error:
                raise InputError(f"{urdf} is not a usable URDF ({error}); correct it.") from None
        robot = cls(config, robot_toml, urdf, text, model, axes)
        robot._check()
        return robot

    def _check(self) -> None:
        for entry, frame in (
            ("tcp_frame", self.config.tcp_frame),
            ("sensor_frame", self.config.sensor_frame),
        ):
            if not self.model.existFrame(frame):
                raise InputError(
                    f'{self.path}: {entry} "{frame}" is no frame of {self.urdf_path.name}; '
                    f"add it there as a link on a fixed joint, or correct the name."
                )
        for block in self.config.compliance:
            if block.joint not in self.joint_names:
                raise InputError(
                    f'{self.path}: [[compliance]] joint "{block.joint}" is no actuated joint of '
                    f"{self.urdf_path.name}; it has {', '.join(self.joint_names)}."
                )
        bad = np.flatnonzero(~(self.lower_rad < self.upper_rad))
        if bad.size:
            raise InputError(
                f"{self.urdf_path}: {self.joint_names[bad[0]]} has no range between its limits; "
                f"give lower and upper in rad."
            )

    @property
    def name(self) -> str:
        """Name in robot.toml."""
        return self.config.name

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Actuated joints in order."""
        return tuple(self.model.names)[1:]

    @cached_property
    def lower_rad(self) -> np.ndarray:
        """Lower joint limits (dof,)."""
        return np.array(self.model.lowerPositionLimit)

    @cached_property
    def upper_rad(self) -> np.ndarray:
        """Upper joint limits (dof,)."""
        return np.array(self.model.upperPositionLimit)

    @cached_property
    def velocity_rad_s(self) -> np.ndarray:
        """Joint speeds (dof,) of the URDF."""
        return np.array(self.model.velocityLimit)

    @cached_property
    def _data(self) -> pin.Data:
        return self.model.createData()

    @cached_property
    def tcp_id(self) -> int:
        """Pinocchio's frame number of the tcp."""
        return self.model.getFrameId(self.config.tcp_frame)

    def forward(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (3, 3) and position (3,) of the tcp in the world at q (dof,)."""
        pin.framesForwardKinematics(self.model, self._data, np.asarray(q, dtype=float))
        placement = self._data.oMf[self.tcp_id]
        return placement.rotation.copy(), placement.translation.copy()

    def forward_batch(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rotations (n, 3, 3) and positions (n, 3) of the tcp at q (n, dof)."""
        both = [self.forward(row) for row in np.atleast_2d(q)]
        n = len(both)
        rotation = np.array([r for r, _ in both]).reshape(n, 3, 3)
        return rotation, np.array([p for _, p in both]).reshape(n, 3)

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Jacobian (6, dof) of the tcp in its own frame, linear part first."""
        return pin.computeFrameJacobian(
            self.model, self._data, np.asarray(q, dtype=float), self.tcp_id, pin.LOCAL
        )


def _parse(urdf: Path, robot_toml: Path) -> ElementTree.Element:
    try:
        root = ElementTree.fromstring(urdf.read_bytes())
    except FileNotFoundError:
        raise InputError(
            f"{robot_toml}: its URDF {urdf} does not exist; correct the entry urdf."
        ) from None
    except (OSError, ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{urdf} is not a readable URDF ({error}); correct it.") from None
    if root.tag != "robot":
        raise InputError(f"{urdf} has <{root.tag}> at its top, not <robot>; name a URDF.")
    return root


def _axes(root: ElementTree.Element, urdf: Path) -> tuple[np.ndarray, ...]:
    """Axes of the turning joints, sorted as Pinocchio will number them; limits completed."""
    axes: dict[str, np.ndarray] = {}
    for joint in root.findall("joint"):
        name, kind = joint.get("name", "?"), joint.get("type")
        if kind in FIXED:
            continue
        if kind not in TURNING:
            raise InputError(
                f"{urdf}: joint {name} is of type {kind}; only revolute, continuous and fixed "
                f"joints are supported."
            )
        limit = joint.find("limit")
        if kind == "continuous":
            speed = "3.14" if limit is None else limit.get("velocity", "3.14")
            joint.set("type", "revolute")
            for old in joint.findall("limit"):
                joint.remove(old)
            ElementTree.SubElement(
                joint, "limit", lower=str(-np.pi), upper=str(np.pi), velocity=speed, effort="0"
            )
        elif limit is None:
            raise InputError(f"{urdf}: revolute joint {name} has no <limit>; add its range.")
        element = joint.find("axis")
        text = "1 0 0" if element is None else element.get("xyz", "1 0 0")
        try:
            axis = np.array([float(v) for v in text.split()])
            axes[name] = axis / np.linalg.norm(axis)
        except ValueError:
            raise InputError(f'{urdf}: joint {name} has axis "{text}"; give 3 numbers.') from None
    if not axes:
        raise InputError(f"{urdf} has no turning joint; name the URDF of a robot arm.")
    with silenced():
        try:
            model = pin.buildModelFromXML(ElementTree.tostring(root, encoding="unicode"))
        except Exception as error:
            raise InputError(f"{urdf} is not a usable URDF ({error}); correct it.") from None
    return tuple(axes[name] for name in tuple(model.names)[1:])


@contextmanager
def silenced() -> Iterator[None]:
    """Keep the URDF parser's own chatter off the terminal (it writes past Python)."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(1), os.dup(2)]
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 1)
        os.dup2(null, 2)
        yield
    finally:
        for number, handle in enumerate(kept, 1):
            os.dup2(handle, number)
            os.close(handle)
        os.close(null)
