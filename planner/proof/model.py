"""The true robot: a model that deviates from the simulation in known ways.

It is there to make recordings whose causes are known. It shares no code with the planner's own
models: it reads URDF and robot.toml itself, and an engine of `mechanics` gives mass and weight.
The robot vibrates about where it sags under gravity, whose own stiffness is part of K, unless
robot.toml says geometric_stiffness = false.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg
from scipy import signal

from planner.proof.deviation import Deviation, Spring
from planner.proof.mechanics import Frame, Mechanics, cross_matrix
from planner.proof.springs import branches, compensation

SAG_STEPS = 30  # at most; each gains a digit or more where springs carry the weight at all


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
    _mechanics: Mechanics = field(repr=False)
    _held: np.ndarray = field(repr=False)  # places of the robot's own joints in x
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
        stiffness = self._springs(q)
        bent = self._sag(q, stiffness)
        gravity = self._gravity(q, bent)
        mechanics = self._posed(q, bent)
        mass = mechanics.mass()[np.ix_(self._elastic, self._elastic)]
        hit = self._own_axes(mechanics.site(self.hit_point))[:3]
        each = []
        for name in self.sensors:
            linear, turn = np.split(self._own_axes(mechanics.site(name)), 2)
            own = self.sensor_offset_m if name == "sensor" else (0.0, 0.0, 0.0)
            each.append(linear - cross_matrix(self.offsets_m.get(name, own)) @ turn)
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
            damping = damping - turning.T @ cross_matrix((0.0, 0.0, self.deviation.spin)) @ turning
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
        if not self._weighs:
            return np.zeros((len(bent), len(bent)))
        return self._mechanics.gravity_stiffness(self._coordinates(q, bent), self._elastic)

    def _sag(self, q: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
        """Angles (e,) at which the springs carry the weight."""
        bent = np.zeros(len(self.springs))
        for _ in range(SAG_STEPS if self._weighs else 0):
            before, bent = (
                bent,
                -np.linalg.solve(stiffness, self._posed(q, bent).weight()[self._elastic]),
            )
            if np.max(np.abs(bent - before)) < 1e-13:
                break
        return bent

    def turning(self, q: np.ndarray) -> np.ndarray:
        """Angular Jacobian (3, e) of the hit point, in its frame: what a moment there acts on."""
        return self._own_axes(self._sagged(q).site(self.hit_point))[3:]

    def frames(self, q: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Jacobians (6, e), linear first, in their own axes: of the sensor, and of each link."""
        mechanics = self._sagged(q)
        sensor = self._own_axes(mechanics.site("sensor"))
        parts = {link: self._own_axes(mechanics.body(first))
                 for link, (first, *_) in self.links().items()}  # fmt: skip
        return sensor, parts

    def pieces(self) -> dict[str, list[tuple[float, np.ndarray, np.ndarray]]]:
        """Mass, centre (3,), inertia about it (3, 3) of a link's bodies, in the first's frame."""
        mechanics = self._posed(np.zeros(len(self._held)))
        found = {}
        for link, numbers in self.links().items():
            axes, origin, _ = mechanics.body(numbers[0])
            pieces = found[link] = []
            for number in numbers:
                part, (rotation, place, _) = mechanics.parts[number], mechanics.body(number)
                turn = axes.T @ rotation
                centre = axes.T @ (place - origin) + turn @ part.centre
                pieces.append((part.mass, centre, turn @ part.tensor @ turn.T))
        return found

    def _own_axes(self, frame: Frame) -> np.ndarray:
        """Jacobian (6, e) of a frame in its own axes, linear first."""
        rotation, _, jacobian = frame
        return np.kron(np.eye(2), rotation.T) @ jacobian[:, self._elastic]

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

    def stiffness(self, joint: str) -> float:
        """Of a joint about its own axis, in N·m/rad."""
        return self.springs[self._own[joint]].stiffness

    def along(
        self, q: np.ndarray, link: str, position_m: np.ndarray, direction: np.ndarray
    ) -> np.ndarray:
        """How a point of a link moves along a world direction (3,) with each spring (e,)."""
        rotation, _, jacobian = self._sagged(q).body(self.links(massless=True)[link][0])
        jacobian = jacobian[:, self._elastic]
        lever = cross_matrix(rotation @ position_m)
        return np.asarray(direction) @ (jacobian[:3] - lever @ jacobian[3:])

    def links(self, massless: bool = False) -> dict[str, list[int]]:
        """Numbers of the bodies that have a link's mass, by the link's name: several if it bends.

        `massless`: also of links without a mass.
        """
        found: dict[str, list[int]] = {}
        for number, part in enumerate(self._mechanics.parts):
            if part.name and (massless or part.mass > 0):
                found.setdefault(part.name.split()[0], []).append(number)
        return found

    def changed(
        self, stiffness: float | np.ndarray = 1.0, damping: float | np.ndarray = 1.0
    ) -> "Truth":
        """The same robot with every spring's stiffness and damping times a factor, or (e,)."""
        each = (np.broadcast_to(factor, len(self.springs)) for factor in (stiffness, damping))
        springs = tuple(
            replace(s, stiffness=float(k) * s.stiffness, damping=float(c) * s.damping,
                    loss=float(c) * s.loss)
            for s, k, c in zip(self.springs, *each, strict=True)
        )  # fmt: skip
        return replace(self, springs=springs)

    def loaded(self, link: str, factor: float) -> "Truth":
        """The same robot with a link's mass and inertia multiplied by a factor."""
        numbers = self.links()[link]
        parts = [
            replace(p, mass=factor * p.mass, tensor=factor * p.tensor) if i in numbers else p
            for i, p in enumerate(self._mechanics.parts)
        ]
        engine = type(self._mechanics)
        return replace(self, _mechanics=engine(parts, self._mechanics.gravity))

    def _coordinates(self, q: np.ndarray, bent: np.ndarray | float) -> np.ndarray:
        """Of the mechanics: joint angles q (dof,) with the springs bent (e,)."""
        x = np.zeros(len(self._mechanics.names))
        x[self._held], x[self._elastic] = q, bent
        return x

    def _posed(self, q: np.ndarray, bent: np.ndarray | float = 0.0) -> Mechanics:
        self._mechanics.pose(self._coordinates(q, bent))
        return self._mechanics

    def _sagged(self, q: np.ndarray) -> Mechanics:
        """At joint angles q (dof,), where the springs carry the weight."""
        return self._posed(q, self._sag(q, self._springs(q)))

    def position(self, q: np.ndarray) -> np.ndarray:
        """Position (3,) of the hit point in the world in m."""
        return self.tcp(q)[1]

    def tcp(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rotation (3, 3), position (3,) and Jacobian (6, dof) of the tcp in the world.

        The Jacobian is that of the robot's own joints, linear part first.
        """
        rotation, place, jacobian = self._posed(q).site("tcp")
        return rotation, place, jacobian[:, self._held]

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


def weights(pole: np.ndarray, step_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """y(t + h) = grow y(t) + older f(t) + newer f(t + h), exact if f is linear between."""
    z = pole * step_s
    grow = np.exp(z)
    newer = (grow - 1 - z) / (z * pole)
    return grow, (grow - 1) / pole - newer, newer


def driven(pole: complex, force: np.ndarray, step_s: float) -> np.ndarray:
    """y (..., n) of y' = λy + f from rest, for f (..., n) linear between samples."""
    grow, older, newer = weights(np.asarray(pole), step_s)
    return np.asarray(signal.lfilter([newer, older], [1.0, -grow], force.astype(complex)))
