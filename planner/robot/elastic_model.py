"""Elastic degrees of freedom as virtual joints: mass matrix and Jacobians at a pose.

Each [[compliance]] of robot.toml is a small rotation right after (outboard of) its joint's own,
about an axis of the joint's child frame; joints themselves are held by their brakes. The mass
matrix does not depend on stiffness or damping (Birk et al. 2025, section 2; Busch et al. 2020,
section 2.1), and is linear in the inertias of the bodies.

How all that changes with the robot's own joint angles: a body's Jacobian in the body's own frame
has the columns J_c. Turning joint k changes those of all that lies between the floor and it by
−[J_k, J_c], the bracket of two motions (Lynch & Park 2017, section 5.1.2 and exercise 5.14), and
leaves the others as they are.
"""

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from planner.errors import InputError
from planner.inference.per_pose import PerPose
from planner.recording.points import TOOL, Layout
from planner.robot.robot import Robot
from planner.robot.virtual_joints import inertia_basis, virtual_model

SINGULAR = 1e-12  # smallest eigenvalue of the mass matrix scaled to ones on its diagonal
SAG_STEPS = 4  # each gains three digits or more where sagging is small at all


@dataclass(frozen=True, eq=False)
class AngleSlopes(PerPose):
    """By each of `dof` joint angles, of n poses and e elastic degrees of freedom.

    `mass` (n, dof, e, e) in kg·m²/rad, `hit` (n, dof, 3h, e) and `sensor` (n, dof, 3s, e) in
    m/rad², `stiffness` (n, dof, e) in N·m/rad² of springs that go with the angle. Left out is
    what moves with the weight: sag and gravity's stiffness change by a thousandth as much.
    """

    mass: np.ndarray
    hit: np.ndarray
    sensor: np.ndarray
    stiffness: np.ndarray


@dataclass(frozen=True, eq=False)
class Matrices(PerPose):
    """Of n poses and e elastic degrees of freedom: M (n, e, e) in kg·m²; Jacobians in m/rad.

    `hit` (n, 3h, e) moves the h hit points, each in its own frame, and `sensor` (n, 3s, e) the
    s sensors; unless others were named, that is the tcp and the sensor. `hit_turn` and
    `sensor_turn`, of the same shapes in rad/rad, turn them. `geometric` (n, e, e) in
    N·m/rad is the stiffness that goes with the pose: gravity's own, harmonics of joint angles; 0
    where robot.toml leaves both out. `by_angle` tells how they change with the joint angles, where
    that was asked.
    """

    mass: np.ndarray
    hit: np.ndarray
    sensor: np.ndarray
    geometric: np.ndarray
    hit_turn: np.ndarray
    sensor_turn: np.ndarray
    by_angle: AngleSlopes | None = None


class ElasticModel:
    """A robot with its elastic degrees of freedom. Raises InputError if there are none.

    `size` is their number e, in the order of robot.toml. `bodies` are what moves: all links that
    turn with a joint, by the joint's name; "base" if elastic. `inertia` (bodies, 10) is m in kg,
    m·c in kg·m, moments xx xy yy xz yz zz in kg·m² about the joint that carries the body, in its
    frame, payloads included.

    `inertia_change` (bodies, 10) is added to the inertias (see `inertia`), so that M is linear in
    it: the weight under which the robot sags stays that of its URDF. Its springs there are those of
    robot.toml unless others carry it (`carried_by`).
    """

    def __init__(self, robot: Robot, inertia_change: np.ndarray | None = None):
        blocks = robot.config.compliance
        if not blocks:
            raise InputError(
                f"{robot.path} has no [[compliance]] block, so there is nothing to simulate; add "
                f'the elastic joints, or set [fidelity] simulation = "none" in campaign.toml.'
            )
        self.robot = robot
        small = robot.config.resonator
        springs = [r.mass * (2 * np.pi * r.frequency_hz) ** 2 for r in small]
        dampers = [4 * np.pi * r.damping_ratio * r.mass * r.frequency_hz for r in small]
        self.size = len(blocks) + len(small)
        self.stiffness = np.array([c.stiffness for c in blocks] + springs)
        self._carrying = self.stiffness
        self.damping = np.array([c.damping for c in blocks] + dampers)
        self.loss_factor = np.array([c.loss_factor for c in blocks] + [0.0] * len(small))
        self._waves = tuple(
            (robot.joint_names.index(wave.joint), self.own_spring(wave.joint), wave)
            for wave in robot.config.harmonic
        )
        self._virtual = virtual_model(robot, inertia_change)
        weighed = self._virtual if inertia_change is None else virtual_model(robot)
        self._model, self._weighed = self._virtual.model, weighed.model
        self._elastic, self.bodies = self._virtual.elastic, self._virtual.bodies
        self.inertia = self._virtual.inertia
        self._check_mass()

    def _check_mass(self) -> None:
        """Every elastic rotation must move inertia of its own; otherwise no M⁻¹ exists."""
        mass = self.matrices(self.robot.middle_rad).mass[0]
        mass = np.where(np.isfinite(mass), mass, 0.0)  # of bodies that no matter can form
        own = np.diagonal(mass)
        least = np.finfo(float).eps * (np.abs(own).max() or 1.0)  # less is rounding, and singular
        scale = np.sqrt(np.maximum(own, least))
        values, vectors = np.linalg.eigh(mass / np.outer(scale, scale))
        if not values[0] > SINGULAR:
            number = int(np.argmax(np.abs(vectors[:, 0])))
            blocks = self.robot.config.compliance
            block = blocks[min(number, len(blocks) - 1)]
            raise InputError(
                f"{self.robot.path}: [[compliance]] number {number + 1} ({block.joint}) moves no "
                f"inertia of its own; give the links outboard of it an <inertial> in "
                f"{self.robot.urdf_path.name} or a [[link]], or remove the block if its axis is "
                f"listed twice."
            )

    def own_spring(self, joint: str) -> int:
        """Number of the block about a joint's own axis; InputError if there is none."""
        for number, block in enumerate(self.robot.config.compliance):
            if block.joint == joint and self.robot.is_own(block):
                return number
        raise InputError(
            f"{self.robot.path}: [[effects]] has a harmonic of {joint}, which has no "
            f"[[compliance]] about its own axis; add that."
        )

    def carried_by(self, stiffness: np.ndarray) -> "ElasticModel":
        """The same robot where springs of stiffness (e,) in N·m/rad carry its weight."""
        other = copy.copy(self)
        other._carrying = stiffness
        return other

    def matrices(
        self,
        q: np.ndarray,
        hits: Sequence[str] = (),
        sensors: Sequence[str] = (),
        layout: Layout = TOOL,
        slopes: bool = False,
    ) -> Matrices:
        """Matrices of poses q (n, dof) in rad, between named frames or points.

        Where none are named, between the points of a layout; with `slopes` also how they change
        with the joint angles. Raises InputError where a frame does not exist.
        """
        q = np.atleast_2d(q)
        n, e, robot = len(q), self.size, self.robot
        own = robot.layout_ids(layout)
        ids = [[robot.place_id("hit frame", name) for name in hits] or own[0]]
        ids += [[robot.place_id("sensor frame", name) for name in sensors] or own[1]]
        # One for each call, so that threads do not meet in it.
        data, weight = self._model.createData(), self._weighed.createData()
        whole = np.empty((n, self._model.nv, self._model.nv))
        geometric, own_axis = np.zeros((n, e, e)), np.arange(e)
        out = [np.empty((n, len(group), 6, self._model.nv)) for group in ids]
        for i, row in enumerate(q):
            full = self._standing(row, weight)
            if robot.config.geometric_stiffness:
                geometric[i] = self._gravity_stiffness(full, weight)
            geometric[i, own_axis, own_axis] += self._with_angle(row)[0]
            whole[i] = pin.crba(self._model, data, full)
            for group, jacobians in zip(ids, out, strict=True):
                for k, number in enumerate(group):
                    frame = self._virtual.frames[number]
                    jacobians[i, k] = pin.computeFrameJacobian(
                        self._model, data, full, frame, pin.LOCAL
                    )
        by_angle = self._slopes(q, *out) if slopes else None
        out = [jacobians @ self._elastic for jacobians in out]
        # Of the mass matrix the upper half is given.
        whole = np.triu(whole) + np.swapaxes(np.triu(whole, 1), 1, 2)
        mass = self._elastic.T @ whole @ self._elastic
        hit, sensor = (jacobians[:, :, :3].reshape(n, -1, e) for jacobians in out)
        hit_turn, sensor_turn = (jacobians[:, :, 3:].reshape(n, -1, e) for jacobians in out)
        return Matrices(mass, hit, sensor, geometric, hit_turn, sensor_turn, by_angle)

    def _slopes(self, q: np.ndarray, hits: np.ndarray, sensors: np.ndarray) -> AngleSlopes:
        """Of Jacobians (n, points, 6, v) of hits and sensors."""
        places = self._virtual.rigid, self._elastic
        inertia = np.einsum("bk,kij->bij", self.inertia, inertia_basis())
        bodies = self._bodies(q)  # M = Σ Jᵀ I J
        slope, momentum = turned(bodies, *places), inertia @ (bodies @ self._elastic)
        n, _, dof, _, e = slope.shape
        rows = np.moveaxis(slope, (2, 4), (1, 2)).reshape(n, dof * e, -1)
        half = (rows @ momentum.reshape(n, -1, e)).reshape(n, dof, e, e)
        stiffness = np.array([self._with_angle(row)[1] for row in q])
        # (n, points, dof, 3, e), the points side by side with their axes.
        moved = (np.moveaxis(turned(ends, *places)[..., :3, :], 1, 2) for ends in (hits, sensors))
        hit, sensor = (one.reshape(n, dof, -1, e) for one in moved)
        return AngleSlopes(half + np.swapaxes(half, 2, 3), hit, sensor, stiffness)

    def body_jacobians(self, q: np.ndarray) -> np.ndarray:
        """(n, bodies, 6, e) at q (n, dof) in rad: how the elastic rotations move the bodies.

        In the frame of the joint that carries the body, linear part (m/rad) first. With the
        spatial inertias I of the bodies (`virtual.inertia_basis`), M = Σ Jᵀ I J.
        """
        return self._bodies(np.atleast_2d(q)) @ self._elastic

    def _bodies(self, q: np.ndarray) -> np.ndarray:
        """The same (n, bodies, 6, v) by all coordinates of the virtual model."""
        data, weight = self._model.createData(), self._weighed.createData()
        out = np.empty((len(q), len(self.bodies), 6, self._model.nv))
        for i, row in enumerate(q):
            pin.computeJointJacobians(self._model, data, self._standing(row, weight))
            for b, joint in enumerate(self._virtual.carriers):
                out[i, b] = pin.getJointJacobian(self._model, data, joint, pin.LOCAL)
        return out

    def sag(self, q: np.ndarray) -> np.ndarray:
        """By how much the springs give (n, e) under the weight at q (n, dof), in rad (slides: m).

        To first order, and also where robot.toml leaves gravity's own stiffness out.
        """
        q, data = np.atleast_2d(q), self._weighed.createData()
        out = np.empty((len(q), self.size))
        for i, row in enumerate(q):
            weight = pin.computeGeneralizedGravity(self._weighed, data, self._upright(row))
            out[i] = -(weight @ self._elastic) / (self._carrying + self._with_angle(row)[0])
        return out

    def _standing(self, q: np.ndarray, data: pin.Data) -> np.ndarray:
        """Coordinates of the virtual model at q (dof,), sagged unless robot.toml says otherwise."""
        full = upright = self._upright(q)
        if self.robot.config.geometric_stiffness:
            stiffness = self._carrying + self._with_angle(q)[0]
            for _ in range(SAG_STEPS):  # K δ = −g(q + δ)
                weight = pin.computeGeneralizedGravity(self._weighed, data, full)
                full = upright - self._elastic @ ((weight @ self._elastic) / stiffness)
        return full

    def _upright(self, q: np.ndarray) -> np.ndarray:
        """Coordinates of the virtual model at q (dof,), without weight."""
        return self._virtual.rigid @ q + self._virtual.offset

    def _with_angle(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What harmonics of q (dof,) add to the stiffness (e,), and its slopes (dof, e)."""
        change, slope = np.zeros(self.size), np.zeros((len(q), self.size))
        for joint, spring, wave in self._waves:
            cosine, sine = np.cos(wave.order * q[joint]), np.sin(wave.order * q[joint])
            change[spring] += wave.cosine * cosine + wave.sine * sine
            slope[joint, spring] += wave.order * (wave.sine * cosine - wave.cosine * sine)
        return change, slope

    def _gravity_stiffness(self, full: np.ndarray, data: pin.Data) -> np.ndarray:
        """Second derivative of the potential energy of the weight, (e, e)."""
        gradient = pin.computeGeneralizedGravityDerivatives(self._weighed, data, full)
        part = self._elastic.T @ np.array(gradient) @ self._elastic
        return (part + part.T) / 2


def turned(jacobian: np.ndarray, rigid: np.ndarray, elastic: np.ndarray) -> np.ndarray:
    """Slopes (..., dof, 6, e) of a Jacobian (..., 6, v) in its own frame, of elastic rotations.

    `rigid` (v, dof) and `elastic` (v, e) say how the joints and the elastic rotations move the v
    coordinates; those nearer to the floor come first.
    """
    turning, giving = (np.flatnonzero(moves.any(axis=1)) for moves in (rigid, elastic))
    joint = np.moveaxis(jacobian[..., turning], -1, -2)[..., None]  # (..., turning, 6, 1)
    inner = (giving < turning[:, None])[:, None]
    column = np.where(inner, jacobian[..., None, :, giving], 0.0)
    linear, angular = slice(0, 3), slice(3, 6)

    def cross(a: slice, b: slice) -> np.ndarray:
        return np.cross(joint[..., a, :], column[..., b, :], axis=-2)

    moved = cross(angular, linear) + cross(linear, angular)
    slopes = -np.concatenate([moved, cross(angular, angular)], axis=-2) @ elastic[giving]
    return np.moveaxis(np.tensordot(rigid[turning], slopes, axes=(0, -3)), 0, -3)
