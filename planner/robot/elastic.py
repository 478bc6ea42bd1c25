"""Elastic degrees of freedom as virtual joints: mass matrix and Jacobians at a pose.

Each [[compliance]] of robot.toml is a small rotation right after (outboard of) its joint's own,
about an axis of the joint's child frame; joints themselves are held by their brakes. The mass
matrix does not depend on stiffness or damping (seed 004, section 2; seed 001, section 2.1).
"""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from planner.errors import InputError
from planner.robot.robot import Robot

SINGULAR = 1e-12  # smallest eigenvalue of the mass matrix scaled to ones on its diagonal


@dataclass(frozen=True, eq=False)
class Matrices:
    """Of n poses and e elastic degrees of freedom: M (n, e, e) in kg·m²; Jacobians in m/rad.

    `hit` (n, 3, e) moves the tcp, in the tcp frame; `sensor` (n, 3, e) the sensor, in its frame.
    """

    mass: np.ndarray
    hit: np.ndarray
    sensor: np.ndarray


class ElasticModel:
    """A robot with its elastic degrees of freedom. Raises InputError if there are none."""

    def __init__(self, robot: Robot):
        if not robot.config.compliance:
            raise InputError(
                f"{robot.path} has no [[compliance]] block, so there is nothing to simulate; add "
                f'the elastic joints, or set [fidelity] simulation = "none" in campaign.toml.'
            )
        self.robot = robot
        self.stiffness = np.array([c.stiffness for c in robot.config.compliance])
        self.damping = np.array([c.damping for c in robot.config.compliance])
        self._model, rigid, elastic, (self._tcp, self._sensor) = _with_virtual_joints(robot)
        self._data = self._model.createData()
        self._rigid, self._elastic = np.array(rigid), np.array(elastic)
        self._grid = np.ix_(self._elastic, self._elastic)
        self._check_mass()

    def _check_mass(self) -> None:
        """Every elastic rotation must move inertia of its own; otherwise no M⁻¹ exists."""
        middle = (self.robot.lower_rad + self.robot.upper_rad) / 2
        mass = self.matrices(middle).mass[0]
        scale = np.sqrt(np.maximum(np.diagonal(mass), np.finfo(float).tiny))
        values, vectors = np.linalg.eigh(mass / np.outer(scale, scale))
        if not values[0] > SINGULAR:
            number = int(np.argmax(np.abs(vectors[:, 0])))
            block = self.robot.config.compliance[number]
            raise InputError(
                f"{self.robot.path}: [[compliance]] number {number + 1} ({block.joint}) moves no "
                f"inertia of its own; give the links outboard of it an <inertial> in "
                f"{self.robot.urdf_path.name}, or remove the block if its axis is listed twice."
            )

    @property
    def size(self) -> int:
        """Number e of elastic degrees of freedom, in the order of robot.toml."""
        return len(self.stiffness)

    def matrices(self, q: np.ndarray) -> Matrices:
        """Matrices of poses q (n, dof) in rad."""
        q = np.atleast_2d(q)
        n, e = len(q), self.size
        mass, hit, sensor = np.empty((n, e, e)), np.empty((n, 3, e)), np.empty((n, 3, e))
        full = np.zeros(self._model.nq)
        for i, row in enumerate(q):
            full[self._rigid] = row
            crba = pin.crba(self._model, self._data, full)
            upper = np.triu(crba)
            symmetric = upper + np.triu(crba, 1).T
            mass[i] = symmetric[self._grid]
            for frame, out in ((self._tcp, hit), (self._sensor, sensor)):
                jacobian = pin.computeFrameJacobian(self._model, self._data, full, frame, pin.LOCAL)
                out[i] = jacobian[:3, self._elastic]
        return Matrices(mass, hit, sensor)


def _with_virtual_joints(
    robot: Robot,
) -> tuple[pin.Model, list[int], list[int], tuple[int, int]]:
    """The robot's model with virtual joints, where its own and they stand in q, tcp and sensor.

    The virtual joints are listed in the order of robot.toml.
    """
    source, config = robot.model, robot.config
    model = pin.Model()
    model.gravity = pin.Motion(np.array([*config.gravity, 0.0, 0.0, 0.0]))
    last = {0: 0}  # joint of the source -> outermost joint that stands for it here
    rigid: list[int] = []
    place: dict[int, int] = {}  # number of the compliance -> its place in q
    for joint in range(1, source.njoints):
        name = str(source.names[joint])
        own = model.addJoint(
            last[source.parents[joint]],
            pin.JointModelRevoluteUnaligned(robot.joint_axes[joint - 1]),
            source.jointPlacements[joint],
            name,
        )
        rigid.append(model.joints[own].idx_q)
        outer = own
        for number, block in enumerate(config.compliance):
            if block.joint == name:
                axis = np.array(block.axis, dtype=float)
                outer = model.addJoint(
                    outer,
                    pin.JointModelRevoluteUnaligned(axis / np.linalg.norm(axis)),
                    pin.SE3.Identity(),
                    f"{name}/elastic_{number}",
                )
                place[number] = model.joints[outer].idx_q
        model.appendBodyToJoint(outer, source.inertias[joint], pin.SE3.Identity())
        last[joint] = outer
    frames = []
    for name, index in (("tcp", robot.tcp_id), ("sensor", robot.sensor_id)):
        frame = source.frames[index]
        parent = last[frame.parentJoint]
        frames.append(
            model.addFrame(pin.Frame(name, parent, 0, frame.placement, pin.FrameType.OP_FRAME))
        )
    elastic = [place[number] for number in range(len(config.compliance))]
    return model, rigid, elastic, (frames[0], frames[1])
