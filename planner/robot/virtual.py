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
    source, config = robot.model, robot.config
    model = pin.Model()
    model.gravity = pin.Motion(np.array([*config.gravity, 0.0, 0.0, 0.0]))
    place: dict[int, int] = {}  # number of the compliance -> its place in q
    last: dict[int, int] = {}  # joint of the source -> outermost joint that stands for it here
    rigid: list[int] = []
    for joint in range(source.njoints):
        name = str(source.names[joint]) if joint else BASE
        outer = 0
        if joint:
            outer = model.addJoint(
                last[source.parents[joint]],
                pin.JointModelRevoluteUnaligned(robot.joint_axes[joint - 1]),
                source.jointPlacements[joint],
                name,
            )
            rigid.append(model.joints[outer].idx_q)
        for number, block in enumerate(config.compliance):
            if block.joint == name and (joint or BASE not in robot.joint_names):
                outer = _elastic_joint(model, outer, block.axis, f"{name}/elastic_{number}")
                place[number] = model.joints[outer].idx_q
        last[joint] = outer
    moving = [joint for joint in range(source.njoints) if last[joint]]
    inertia = np.array([_inertia(robot, joint) for joint in moving])
    if inertia_change is not None:
        inertia = inertia + inertia_change
    for joint, values in zip(moving, inertia, strict=True):
        body = pin.Inertia.FromDynamicParameters(values) if values[0] else pin.Inertia.Zero()
        model.appendBodyToJoint(last[joint], body, pin.SE3.Identity())
    frames = tuple(
        model.addFrame(pin.Frame(f.name, last[f.parentJoint], 0, f.placement, f.type))
        for f in source.frames
    )
    return VirtualModel(
        model,
        np.array(rigid),
        np.array([place[number] for number in range(len(config.compliance))]),
        tuple(str(source.names[joint]) if joint else BASE for joint in moving),
        tuple(last[joint] for joint in moving),
        inertia,
        frames,
    )


def _elastic_joint(
    model: pin.Model, parent: int, axis: tuple[float, float, float], name: str
) -> int:
    direction = np.array(axis, dtype=float)
    kind = pin.JointModelRevoluteUnaligned(direction / np.linalg.norm(direction))
    return model.addJoint(parent, kind, pin.SE3.Identity(), name)


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
