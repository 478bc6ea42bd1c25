"""The true robot: a MuJoCo model that deviates from the simulation in known ways.

This engine is there to make recordings whose causes are known. It shares no code with the
planner's own models: it reads URDF and robot.toml itself, and MuJoCo gives mass matrix and weight.
The robot vibrates about where it sags under gravity, whose own stiffness is part of K, unless
robot.toml says geometric_stiffness = false.
"""

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy.linalg

from planner.truth.deviation import Deviation, Spring
from planner.truth.loss_factors import branches
from planner.truth.propagate import driven
from planner.truth.springs import compensation

SAG_STEPS = 30  # at most; each gains a digit or more where springs carry the weight at all
TURN = 1e-4  # rad (or m), of the differences that give gravity's stiffness: exact to 1e-8


@dataclass(frozen=True, eq=False)
class Truth:
    """A linear vibrating robot at any pose; angles in rad, joints that slide in m."""

    name: str
    joint_names: tuple[str, ...]
    springs: tuple[Spring, ...]
    deviation: Deviation
    description: str
    lower_rad: np.ndarray  # joint limits (dof,)
    upper_rad: np.ndarray
    _model: object = field(repr=False)
    _data: object = field(repr=False)
    _held: np.ndarray = field(repr=False)  # places of the robot's own joints in q
    _elastic: np.ndarray = field(repr=False)
    _own: dict[str, int] = field(repr=False)  # joint: its spring about its own axis
    _weighs: bool = field(repr=False)  # whether gravity is part of the model
    stated: int = 0  # how many of the springs robot.toml states; they are the first
    sensor_offset_m: tuple[float, float, float] = (0.0, 0.0, 0.0)  # from where it is stated
    hit_point: str = "tcp"  # or one of robot.toml's points, as all sensors are
    sensors: tuple[str, ...] = ("sensor",)
    offsets_m: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)  # of others
    sensor_mass_kg: Mapping[str, float] = field(default_factory=dict)
    slides: tuple[bool, ...] = ()  # which joints do; none where it is empty

    def matrices(
        self, q: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """M, C, K (e, e) and the Jacobians of hit point (3, e) and sensors (3s, e).

        In their own frames.
        """
        import mujoco

        stiffness = self._springs(q)
        bent = self._sag(q, stiffness)
        gravity = self._gravity(q, bent)
        model, data = self._posed(q, bent)
        mujoco.mj_crb(model, data)
        mass = _full_mass(model, data)[np.ix_(self._elastic, self._elastic)]
        hit, _ = self._site(model, data, self.hit_point)
        each = []
        for name in self.sensors:
            linear, turn = self._site(model, data, name)
            own = self.sensor_offset_m if name == "sensor" else (0.0, 0.0, 0.0)
            each.append(linear - _cross(self.offsets_m.get(name, own)) @ turn)
            mass = mass + self.sensor_mass_kg.get(name, 0.0) * each[-1].T @ each[-1]
        sensor = np.concatenate(each)
        damping = np.diag(self.factors(q) * [s.damping for s in self.springs])
        stiffness = stiffness + gravity
        for bridge in self.deviation.bridges:
            ends = zip(bridge.links, bridge.positions_m, strict=True)
            one, other = (
                self.along(q, link, np.array(at), np.array(bridge.direction)) for link, at in ends
            )
            stiffness = stiffness + bridge.stiffness * np.outer(one - other, one - other)
            damping = damping + bridge.damping * np.outer(one - other, one - other)
        if self.deviation.spin:
            turning = self.turning(q)
            damping = damping - turning.T @ _cross((0.0, 0.0, self.deviation.spin)) @ turning
        return mass, damping, stiffness, hit, sensor

    def gravity_stiffness(self, q: np.ndarray) -> np.ndarray:
        """Gravity's part (e, e) of K: how the weight's torques change with the springs' angles."""
        return self._gravity(q, self._sag(q, self._springs(q)))

    def _springs(self, q: np.ndarray) -> np.ndarray:
        """K (e, e) without gravity's part."""
        stiffness = np.diag(self.factors(q) * [s.stiffness for s in self.springs])
        for loop in self.deviation.feedback:
            stiffness[self._own[loop.driven], self._own[loop.sensed]] += loop.gain
        for spring in self.deviation.compensators:
            at = self._own[spring.joint]
            stiffness[at, at] += compensation(spring, q[self.joint_names.index(spring.joint)])
        return stiffness

    def _gravity(self, q: np.ndarray, bent: np.ndarray) -> np.ndarray:
        steps = TURN * np.eye(len(bent)) if self._weighs else ()
        change = [self._weight(q, bent + s) - self._weight(q, bent - s) for s in steps]
        part = np.array(change) / (2 * TURN) if change else np.zeros((len(bent), len(bent)))
        return (part + part.T) / 2

    def _sag(self, q: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
        """Angles (e,) at which the springs carry the weight."""
        bent = np.zeros(len(self.springs))
        for _ in range(SAG_STEPS if self._weighs else 0):
            before, bent = bent, -np.linalg.solve(stiffness, self._weight(q, bent))
            if np.max(np.abs(bent - before)) < 1e-13:
                break
        return bent

    def _weight(self, q: np.ndarray, bent: np.ndarray) -> np.ndarray:
        """Torques (e,) that hold the robot against gravity with its springs bent (e,)."""
        import mujoco

        model, data = self._posed(q, bent)
        mujoco.mj_comVel(model, data)  # at rest: clears what a body would inherit
        torque = np.zeros(model.nv)
        mujoco.mj_rne(model, data, 0, torque)
        return torque[self._elastic]

    def turning(self, q: np.ndarray) -> np.ndarray:
        """Angular Jacobian (3, e) of the hit point, in its frame: what a moment there acts on."""
        model, data = self._posed(q, self._sag(q, self._springs(q)))
        return self._site(model, data, self.hit_point)[1]

    def frames(self, q: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Jacobians (6, e), linear first, in their own axes: of the sensor, and of each link."""
        import mujoco

        model, data = self._posed(q, self._sag(q, self._springs(q)))
        sensor, parts = np.vstack(self._site(model, data, "sensor")), {}
        for link, (first, *_) in self.links().items():
            linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
            mujoco.mj_jacBody(model, data, linear, angular, first)
            axes = data.xmat[first].reshape(3, 3).T
            parts[link] = np.vstack([axes @ linear, axes @ angular])[:, self._elastic]
        return sensor, parts

    def pieces(self) -> dict[str, list[tuple[float, np.ndarray, np.ndarray]]]:
        """Mass, centre (3,), inertia about it (3, 3) of a link's bodies, in the first's frame."""
        model, data = self._posed(np.zeros(len(self._held)))
        found = {}
        for link, numbers in self.links().items():
            axes, place = data.xmat[numbers[0]].reshape(3, 3), data.xpos[numbers[0]]
            found[link] = [
                (float(model.body_mass[b]), axes.T @ (data.xipos[b] - place),
                 turn @ np.diag(model.body_inertia[b]) @ turn.T)
                for b in numbers
                for turn in [axes.T @ data.ximat[b].reshape(3, 3)]
            ]  # fmt: skip
        return found

    def _site(self, model: object, data: object, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Linear and angular Jacobian (3, e) of a site, in its own frame."""
        import mujoco

        linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacSite(model, data, linear, angular, model.site(name).id)
        rotation = data.site(name).xmat.reshape(3, 3)
        return (rotation.T @ linear)[:, self._elastic], (rotation.T @ angular)[:, self._elastic]

    def factors(self, q: np.ndarray) -> np.ndarray:
        """What the stiffness of each spring (e,) is multiplied by at this pose."""
        factors = np.ones(len(self.springs))
        for wave in self.deviation.harmonics:
            angle = wave.order * q[self.joint_names.index(wave.by or wave.joint)]
            change = wave.cosine * np.cos(angle) + wave.sine * np.sin(angle)
            factors[self._own[wave.joint]] += change
        return factors

    def own(self, joint: str) -> np.ndarray:
        """Unit vector (e,) of a joint's elastic rotation about its own axis."""
        return np.eye(len(self.springs))[self._own[joint]]

    def along(
        self, q: np.ndarray, link: str, position_m: np.ndarray, direction: np.ndarray
    ) -> np.ndarray:
        """How a point of a link moves along a world direction (3,) with each spring (e,)."""
        import mujoco

        model, data = self._posed(q, self._sag(q, self._springs(q)))
        body = model.body(link).id
        point = data.body(link).xpos + data.body(link).xmat.reshape(3, 3) @ position_m
        jacobian = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, jacobian, None, point, body)
        return np.asarray(direction) @ jacobian[:, self._elastic]

    def links(self) -> dict[str, list[int]]:
        """The model's bodies that have a link's mass, by the link's name: several if it bends."""
        model: Any = self._model
        found: dict[str, list[int]] = {}
        for body in range(1, model.nbody):
            if model.body(body).name and model.body_mass[body] > 0:
                found.setdefault(model.body(body).name.split()[0], []).append(body)
        return found

    def changed(self, factor: float | np.ndarray) -> "Truth":
        """The same robot with the stiffness of every spring multiplied by a factor, or (e,)."""
        each = np.broadcast_to(factor, len(self.springs))
        springs = tuple(
            replace(s, stiffness=float(f) * s.stiffness)
            for s, f in zip(self.springs, each, strict=True)
        )
        return replace(self, springs=springs)

    def loaded(self, link: str, factor: float) -> "Truth":
        """The same robot with a link's mass and inertia multiplied by a factor."""
        model: Any = copy.copy(self._model)
        bodies = self.links()[link]
        model.body_mass[bodies] *= factor
        model.body_inertia[bodies] *= factor
        return replace(self, _model=model)

    def _posed(self, q: np.ndarray, bent: np.ndarray | float = 0.0) -> tuple:
        """MuJoCo's model and data at joint angles q (dof,) with the springs bent (e,)."""
        import mujoco

        model, data = self._model, self._data
        data.qpos[:] = 0.0
        data.qpos[self._held] = q
        data.qpos[self._elastic] = bent
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        return model, data

    def position(self, q: np.ndarray) -> np.ndarray:
        """Position (3,) of the hit point in the world in m."""
        return self.tcp(q)[1]

    def tcp(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rotation (3, 3), position (3,) and Jacobian (6, dof) of the tcp in the world.

        The Jacobian is that of the robot's own joints, linear part first.
        """
        import mujoco

        model, data = self._posed(q)
        linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacSite(model, data, linear, angular, model.site("tcp").id)
        jacobian = np.vstack([linear, angular])[:, self._held]
        site = data.site("tcp")
        return np.array(site.xmat).reshape(3, 3), np.array(site.xpos), jacobian

    def modal(
        self, q: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Poles (p,) in rad/s, shapes V (e, p), participations W (p, e), and both Jacobians.

        x = V y and y' = λ y + W f for generalised forces f (e,).
        """
        mass, damping, stiffness, hit, sensor = self.matrices(q)
        e, inverse = len(mass), np.linalg.inv(mass)
        maxwell = self.relaxing(q)
        n = 2 * e + len(maxwell)  # states: places, speeds, and where each branch's damper is
        system = np.zeros((n, n))
        system[:e, e : 2 * e] = np.eye(e)
        whole = stiffness.copy()
        for k, (j, more, rate) in enumerate(maxwell, 2 * e):
            whole[j, j] += more
            system[e : 2 * e, k] = more * inverse[:, j]
            system[k, j], system[k, k] = rate, -rate
        system[e : 2 * e, :e] = -inverse @ whole
        system[e : 2 * e, e : 2 * e] = -inverse @ damping
        poles, vectors = scipy.linalg.eig(system)[:2]
        entry = np.linalg.inv(vectors)[:, e : 2 * e] @ inverse
        return poles, vectors[:e], entry, hit, sensor

    def relaxing(self, q: np.ndarray) -> list[tuple[int, float, float]]:
        """(spring, stiffness, rate in 1/s) of what holds only against fast motion."""
        own = self.factors(q) * [s.stiffness for s in self.springs]
        found = branches(self.springs, own)
        for loop in self.deviation.servos:
            at = self._own[loop.joint]
            found.append((at, float(loop.share * own[at]), 2 * np.pi * loop.corner_hz))
        return found

    def poles(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Poles (2e,) in rad/s, receptance residues (2e, 3s, 3), and Js M⁻¹ Jhᵀ (3s, 3)."""
        poles, shapes, entry, hit, sensor = self.modal(q)
        residues = np.einsum("ik,kj->kij", sensor @ shapes, entry @ hit.T)
        return poles, residues, sensor @ np.linalg.solve(self.matrices(q)[0], hit.T)

    def modes(self, q: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Natural frequencies (m,) in Hz, damping ratios (m,), residues (m, 3, 3), lowest first."""
        poles, residues, _ = self.poles(q)
        order = [k for k in np.argsort(np.abs(poles)) if poles[k].imag > 1e-6][:count]
        size = np.abs(poles[order])
        return size / (2 * np.pi), -poles[order].real / size, residues[order]

    def accelerance(self, q: np.ndarray, frequency_hz: np.ndarray) -> np.ndarray:
        """Accelerance (3s, 3, F) in m/s²/N."""
        poles, residues, _ = self.poles(q)
        iw = 2j * np.pi * np.asarray(frequency_hz)
        return iw**2 * np.einsum("kij,kf->ijf", residues, 1 / (iw - poles[:, None]))

    def respond(self, q: np.ndarray, force_n: np.ndarray, axis: int, step_s: float) -> np.ndarray:
        """Accelerations (3s, n) in m/s² of the sensors to a force (n,) along tcp axis 0, 1 or 2.

        From rest, and exact for a force that is linear between samples: each pole obeys
        x' = λx + f and a = Σ λ²R x + D f with D = Js M⁻¹ Jhᵀ, because Σ R = 0 and Σ λR = D.
        """
        poles, residues, direct = self.poles(q)
        out = np.outer(direct[:, axis], force_n)
        for pole, residue in zip(poles, residues[:, :, axis], strict=True):
            if pole.imag >= 0:  # the other of a pair adds the conjugate
                twice = 2.0 if pole.imag > 0 else 1.0
                y = driven(pole, force_n, step_s)
                out += twice * np.outer(residue * pole**2, y).real
        return out


def _cross(vector: tuple[float, float, float]) -> np.ndarray:
    """(3, 3): what turns ω into v × ω."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _full_mass(model: object, data: object) -> np.ndarray:
    import mujoco

    full = np.zeros((model.nv, model.nv))
    try:
        mujoco.mj_fullM(model, data, full)
    except TypeError:  # before MuJoCo 3.5 the arguments were (model, full, qM)
        mujoco.mj_fullM(model, full, data.qM)
    return full
