"""The robot in a Rerun recording: the shapes of its URDF, and capsules where it has none."""

import tempfile
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.urdf as rru
from rerun.chunk import Chunk
from scipy.spatial.transform import Rotation

from planner.robot.link_bodies import BodyShape, bodies
from planner.robot.robot import Robot

WORLD = "tf#/"  # Rerun's frame of the root entity, in which entities lie that name no frame
NOT_SHAPES = ("rerun.controls", "CoordinateFrame", "InstancePoses3D", "Transform3D")


class RobotDrawing:
    """Draws the robot once, and moves it. Raises whatever Rerun's loader makes of the URDF.

    What turns together (links on fixed joints) is one body. A body is drawn as its visual shapes;
    without any as its collision shapes; without those as capsules from its joint to the next ones
    and to the tcp.
    """

    def __init__(self, robot: Robot, stream: rr.RecordingStream):
        self._robot, self._bodies, self._stream = robot, bodies(robot), stream
        self._tree, chunks = _load(robot)
        hidden = self._without_shapes(chunks)
        rr.send_chunks([c for c in chunks if c.entity_path not in hidden], recording=stream)
        # Links have frames of their own names, which nothing connects to the frames of entities.
        root = self._frame(self._tree.root_link().name)
        world = rr.Transform3D(translation=[0.0, 0.0, 0.0], parent_frame=WORLD, child_frame=root)
        stream.log("robot/world", world, static=True)

    def move(self, q: np.ndarray) -> None:
        """Bring the robot to q (dof,) in rad (slides: m), at the recording's current time."""
        linkage = self._robot.linkage
        for name, angle in zip(linkage.names, linkage.at(q), strict=True):
            joint = self._tree.get_joint_by_name(name)
            if joint is not None:
                transform = joint.compute_transform(float(angle), clamp=False)
                self._stream.log(f"robot/joints/{name}", transform)

    def _without_shapes(self, chunks: list[Chunk]) -> set[str]:
        """Draw capsules for bodies without shapes; returns paths of shapes not to be shown."""
        shown = {chunk.entity_path for chunk in chunks if _has_shape(chunk)}
        hidden: set[str] = set()
        for body in self._bodies:
            links = body.links
            visual = {p for link in links for p in self._tree.get_visual_geometry_paths(link)}
            collision = {p for link in links for p in self._tree.get_collision_geometry_paths(link)}
            if visual & shown:
                hidden |= collision
            elif not collision & shown:
                self._capsules(body)
        return hidden

    def _frame(self, link: str) -> str:
        """Rerun's name of a link's frame."""
        return f"{self._tree.frame_prefix or ''}{link}"

    def _capsules(self, body: BodyShape) -> None:
        path = f"robot/capsules/{body.link}"
        self._stream.log(path, rr.CoordinateFrame(self._frame(body.link)), static=True)
        capsules = rr.Capsules3D(
            lengths=np.linalg.norm(body.ends_m, axis=1),
            radii=0.025 * self._robot.arm_m,
            quaternions=[_turn_from_z(end) for end in body.ends_m],
            colors=(150, 150, 155),
            fill_mode="solid",
        )
        self._stream.log(path, capsules, static=True)


def _load(robot: Robot) -> tuple[rru.UrdfTree, list[Chunk]]:
    """The tree, and what it would log."""
    with tempfile.TemporaryDirectory() as folder:
        urdf = Path(folder) / robot.urdf_path.name
        urdf.write_text(robot.urdf_text, encoding="utf-8")
        tree = rru.UrdfTree.from_file_path(urdf, entity_path_prefix="robot")
        return tree, tree.stream().to_chunks()


def _has_shape(chunk: Chunk) -> bool:
    """Whether it draws anything: a mesh that cannot be read leaves an entity without a shape."""
    names = chunk.to_record_batch().schema.names
    return not all(name.startswith(NOT_SHAPES) for name in names)


def _turn_from_z(direction: np.ndarray) -> np.ndarray:
    """Quaternion (x, y, z, w) of the shortest turn from the z axis to a direction (3,)."""
    if not np.any(direction):
        return Rotation.identity().as_quat()
    return Rotation.align_vectors(direction, (0.0, 0.0, 1.0))[0].as_quat()
