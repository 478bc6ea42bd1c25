"""Virtual joints: a robot's model with one more revolute joint for each elastic rotation."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from planner.robot.robot import BASE, Robot

INERTIA_NAMES = ("m", "mx", "my", "mz", "xx", "xy", "yy", "xz", "yz", "zz")  # Pinocchio's order


@dataclass(frozen=True, eq=False)
class VirtualModel:
    """Model in whose coordinates the robot's own joints and the elastic ones have their places.

    `elastic` follows robot.toml, `bodies` names what moves (joints, and the base where it is
    elastic), `carriers` are the joints of `model` that carry them, `frames` translates the
    robot's frame numbers.
    """

    model: pin.Model
    rigid: np.ndarray
    elastic: np.ndarray
    bodies: tuple[str, ...]
    carriers: tuple[int, ...]
    inertia: np.ndarray  # (bodies, 10) about the joints' frames, as INERTIA_NAMES lists them
    frames: tuple[int, ...]


def virtual_model(robot: Robot, inertia_change: np.ndarray | None = None) -> VirtualModel:
    """The virtual model; inertia_change (bodies, 10) is added to the inertias of its bodies."""
    source, model = robot.model, pin.Model()
    model.gravity = pin.Motion(np.array([*robot.config.gravity, 0.0, 0.0, 0.0]))
    last, rigid, elastic = _add_joints(robot, model)
    moving = [joint for joint in range(source.njoints) if last[joint]]
    inertia = np.array([_inertia(robot, joint) for joint in moving])
    if inertia_change is not None:
        inertia = inertia + inertia_change
    for joint, values in zip(moving, inertia, strict=True):
        model.appendBodyToJoint(last[joint], _body(values), pin.SE3.Identity())
    frames = tuple(
        model.addFrame(pin.Frame(f.name, last[f.parentJoint], 0, f.placement, f.type))
        for f in source.frames
    )
    names = tuple(str(source.names[joint]) if joint else BASE for joint in moving)
    carriers = tuple(last[joint] for joint in moving)
    return VirtualModel(model, rigid, elastic, names, carriers, inertia, frames)


def _add_joints(robot: Robot, model: pin.Model) -> tuple[list[int], np.ndarray, np.ndarray]:
    """Outermost joint that stands for each of the robot's; places of its own and of the elastic."""
    source, blocks = robot.model, robot.config.compliance
    last: list[int] = []
    rigid: list[int] = []
    elastic = np.zeros(len(blocks), dtype=int)
    for joint in range(source.njoints):
        name, outer = (str(source.names[joint]) if joint else BASE), 0
        if joint:
            axis, place = robot.joint_axes[joint - 1], source.jointPlacements[joint]
            outer = _add_joint(model, last[source.parents[joint]], axis, place, name)
            rigid.append(model.joints[outer].idx_q)
        for number, block in enumerate(blocks):
            if block.joint == name and (joint or BASE not in robot.joint_names):
                axis, place = np.array(block.axis, dtype=float), pin.SE3.Identity()
                outer = _add_joint(model, outer, axis, place, f"{name}/elastic_{number}")
                elastic[number] = model.joints[outer].idx_q
        last.append(outer)
    return last, np.array(rigid), elastic


def _add_joint(
    model: pin.Model, parent: int, axis: np.ndarray, placement: pin.SE3, name: str
) -> int:
    kind = pin.JointModelRevoluteUnaligned(axis / np.linalg.norm(axis))
    return model.addJoint(parent, kind, placement, name)


def _body(values: np.ndarray) -> pin.Inertia:
    if values[0] != 0:
        return pin.Inertia.FromDynamicParameters(values)
    xx, xy, yy, xz, yz, zz = values[4:]
    moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return pin.Inertia(0.0, np.zeros(3), moments)


def _inertia(robot: Robot, joint: int) -> np.ndarray:
    """(10,) of all links that a joint carries, and of the payloads on them."""
    total = robot.model.inertias[joint]
    for block in robot.config.payload:
        frame = robot.model.frames[robot.frame_id("[[payload]] link", block.link)]
        if frame.parentJoint == joint:
            xx, yy, zz, xy, xz, yz = block.inertia
            moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            body = pin.Inertia(block.mass, np.array(block.com_m, dtype=float), moments)
            total = total + frame.placement.act(body)
    return np.array(total.toDynamicParameters())


def inertia_basis() -> np.ndarray:
    """(10, 6, 6): the spatial inertia of a body is their sum weighted by its parameters.

    Linear velocities first (Featherstone 2008, eq. 2.63, with its halves swapped).
    """
    basis = np.zeros((10, 6, 6))
    basis[0, :3, :3] = np.eye(3)
    for axis in range(3):
        cross = np.cross(np.eye(3)[axis], np.eye(3)).T  # column k is e_axis × e_k
        basis[1 + axis, :3, 3:] = -cross
        basis[1 + axis, 3:, :3] = cross
    for number, (i, j) in enumerate([(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)], 4):
        basis[number, 3 + i, 3 + j] = basis[number, 3 + j, 3 + i] = 1.0
    return basis
