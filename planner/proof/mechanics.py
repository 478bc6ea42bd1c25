"""Rigid bodies on joints, by two engines: MuJoCo, and a tree of frames in NumPy.

They share nothing but the list of parts that they are given, and nothing with the planner.
"""

import warnings
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

STEP = 1e-4  # rad (or m), of the differences that give gravity's stiffness: exact to 1e-8


@dataclass(frozen=True)
class Hinge:
    """A coordinate of a part: it turns about an axis (3,) in its frame, or slides along it."""

    name: str
    axis: Sequence[float] | np.ndarray
    slides: bool = False


@dataclass(frozen=True, eq=False)
class Part:
    """A body: parent's number (-1 the ground), place (3,) and rotation (3, 3) in it, coordinates.

    Mass, centre (3,) and inertia (3, 3) about it in its own frame; no mass: none. `sites` are named
    frames on it: name, place, rotation.
    """

    name: str
    parent: int
    place: np.ndarray
    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    hinges: Sequence[Hinge] = ()
    sites: Sequence[tuple[str, np.ndarray, np.ndarray]] = ()
    mass: float = 0.0
    centre: np.ndarray = field(default_factory=lambda: np.zeros(3))
    tensor: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))


Frame = tuple[np.ndarray, np.ndarray, np.ndarray]


class Mechanics(ABC):
    """What an engine tells of parts under gravity (3,) in m/s², at coordinates x (n,).

    Frames are rotation (3, 3), place (3,) in m and Jacobian (6, n), linear first, in the world.
    """

    def __init__(self, parts: Sequence[Part], gravity: Sequence[float] | np.ndarray) -> None:
        self.parts, self.gravity = tuple(parts), np.array(gravity, dtype=float)
        self.names = [hinge.name for part in parts for hinge in part.hinges]
        self.version = "tree of frames"

    @abstractmethod
    def pose(self, x: np.ndarray) -> None:
        """Go to coordinates; all that follows is there."""

    @abstractmethod
    def mass(self) -> np.ndarray:
        """Mass matrix (n, n)."""

    @abstractmethod
    def weight(self) -> np.ndarray:
        """Torques (n,) that hold the parts against gravity."""

    @abstractmethod
    def body(self, number: int) -> Frame:
        """Of a part."""

    @abstractmethod
    def site(self, name: str) -> Frame:
        """Of a named frame."""

    def gravity_stiffness(self, x: np.ndarray, along: np.ndarray) -> np.ndarray:
        """How the weight's torques along some coordinates (k,) change with them (k, k)."""
        out = []
        for step in STEP * np.eye(len(x))[along]:
            ends = []
            for end in (x + step, x - step):
                self.pose(end)
                ends.append(self.weight()[along])
            out.append((ends[0] - ends[1]) / (2 * STEP))
        part = np.array(out)
        return (part + part.T) / 2


class Mujoco(Mechanics):
    """By MuJoCo."""

    def __init__(self, parts: Sequence[Part], gravity: Sequence[float] | np.ndarray) -> None:
        super().__init__(parts, gravity)
        import mujoco

        mujoco.set_mju_user_warning(lambda text: None)  # it would warn into a file
        spec = mujoco.MjSpec()
        spec.option.gravity = self.gravity
        kinds = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE
        bodies = [spec.worldbody]
        for part in parts:
            body = bodies[part.parent + 1].add_body(
                name=part.name, pos=part.place, quat=_quaternion(part.rotation)
            )
            for hinge in part.hinges:
                body.add_joint(name=hinge.name, type=kinds[hinge.slides], axis=list(hinge.axis))
            for name, place, rotation in part.sites:
                body.add_site(name=name, pos=place, quat=_quaternion(rotation))
            if part.mass:
                t = part.tensor
                body.mass, body.ipos, body.explicitinertial = part.mass, part.centre, True
                body.fullinertia = [t[0, 0], t[1, 1], t[2, 2], t[0, 1], t[0, 2], t[1, 2]]
            bodies.append(body)
        with warnings.catch_warnings():
            # It checks the springs' dynamics without their stiffness.
            warnings.simplefilter("ignore")
            self._mujoco, self._model = mujoco, spec.compile()
        self.version = f"MuJoCo {mujoco.__version__}"
        self._data = mujoco.MjData(self._model)
        self._ids = [body.id for body in bodies[1:]]
        self._order = [self._model.joint(name).dofadr[0] for name in self.names]

    def pose(self, x: np.ndarray) -> None:
        self._data.qpos[self._order] = x
        self._mujoco.mj_kinematics(self._model, self._data)
        self._mujoco.mj_comPos(self._model, self._data)

    def mass(self) -> np.ndarray:
        full = np.zeros((self._model.nv, self._model.nv))
        self._mujoco.mj_crb(self._model, self._data)
        self._mujoco.mj_fullM(self._model, self._data, full)
        return full[np.ix_(self._order, self._order)]

    def weight(self) -> np.ndarray:
        torque = np.zeros(self._model.nv)
        self._mujoco.mj_comVel(self._model, self._data)  # at rest: clears what would be inherited
        self._mujoco.mj_rne(self._model, self._data, 0, torque)
        return torque[self._order]

    def body(self, number: int) -> Frame:
        at = self._ids[number]
        return self._frame(self._mujoco.mj_jacBody, at, self._data.xmat[at], self._data.xpos[at])

    def site(self, name: str) -> Frame:
        at = self._data.site(name)
        return self._frame(self._mujoco.mj_jacSite, self._model.site(name).id, at.xmat, at.xpos)

    def _frame(self, jacobian, number: int, rotation: np.ndarray, place: np.ndarray) -> Frame:
        both = np.zeros((2, 3, self._model.nv))
        jacobian(self._model, self._data, both[0], both[1], number)
        return rotation.reshape(3, 3).copy(), place.copy(), both.reshape(6, -1)[:, self._order]


def cross_matrix(v: Sequence[float] | np.ndarray) -> np.ndarray:
    """(3, 3): what turns u into v × u."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    return Rotation.from_matrix(rotation).as_quat(scalar_first=True)


class FrameTree(Mechanics):
    """By hand: Jacobians of axes and origins, and energies from these.

    M = Σ Jvᵀ m Jv + Jwᵀ I Jw, and gravity's stiffness from V = -Σ m g·c with d²c/dxᵢdxⱼ = zᵢ x
    (dc/dxⱼ), i being the inner one.
    """

    def __init__(self, parts: Sequence[Part], gravity: Sequence[float] | np.ndarray) -> None:
        super().__init__(parts, gravity)
        self._turns = np.array([not h.slides for part in parts for h in part.hinges], bool)[:, None]
        self._moves = np.zeros((len(parts), len(self.names)), bool)  # which coordinates move which
        first = 0
        for i, part in enumerate(parts):
            if part.parent >= 0:
                self._moves[i] = self._moves[part.parent]
            self._moves[i, first : first + len(part.hinges)] = True
            first += len(part.hinges)
        self._sites = {site[0]: (i, *site[1:]) for i, p in enumerate(parts) for site in p.sites}

    def pose(self, x: np.ndarray) -> None:
        values, axes, origins = iter(x), [], []
        self._frames: list[tuple[np.ndarray, np.ndarray]] = []
        for part in self.parts:
            rotation, place = self._frames[part.parent] if part.parent >= 0 else (
                np.eye(3), np.zeros(3))  # fmt: skip
            place, rotation = place + rotation @ part.place, rotation @ part.rotation
            for hinge in part.hinges:
                axis, value = np.array(hinge.axis) / np.linalg.norm(hinge.axis), next(values)
                axes.append(rotation @ axis)
                origins.append(place)
                if hinge.slides:
                    place = place + value * axes[-1]
                elif value:
                    rotation = rotation @ Rotation.from_rotvec(value * axis).as_matrix()
            self._frames.append((rotation, place))
        self._axes, self._origins = np.array(axes), np.array(origins)
        self._carried = [
            (part, self._jacobian(i, place + rotation @ part.centre), rotation, self._moves[i])
            for i, (part, (rotation, place)) in enumerate(
                zip(self.parts, self._frames, strict=True)
            )
            if part.mass
        ]

    def _jacobian(self, number: int, place: np.ndarray) -> np.ndarray:
        linear = np.where(self._turns, np.cross(self._axes, place - self._origins), self._axes)
        angular = np.where(self._turns, self._axes, 0.0)
        return np.hstack([linear, angular]).T * self._moves[number]

    def mass(self) -> np.ndarray:
        total = np.zeros((len(self.names), len(self.names)))
        for part, jacobian, rotation, _ in self._carried:
            inertia = rotation @ part.tensor @ rotation.T
            total += part.mass * jacobian[:3].T @ jacobian[:3]
            total += jacobian[3:].T @ inertia @ jacobian[3:]
        return total

    def weight(self) -> np.ndarray:
        first = sum(part.mass * jacobian[:3] for part, jacobian, *_ in self._carried)
        return -self.gravity @ first

    def body(self, number: int) -> Frame:
        rotation, place = self._frames[number]
        return rotation, place, self._jacobian(number, place)

    def site(self, name: str) -> Frame:
        number, place, turn = self._sites[name]
        rotation, origin = self._frames[number]
        place = origin + rotation @ place
        return rotation @ turn, place, self._jacobian(number, place)

    def gravity_stiffness(self, x: np.ndarray, along: np.ndarray) -> np.ndarray:
        self.pose(x)
        lever = np.where(self._turns, np.cross(self.gravity, self._axes), 0.0)
        outer = np.zeros((len(x), len(x)))  # rows: the inner coordinate
        for part, jacobian, _, moves in self._carried:
            outer -= part.mass * (lever * moves[:, None]) @ jacobian[:3]
        upper = np.triu(outer)
        return (upper + np.triu(upper, 1).T)[np.ix_(along, along)]


ENGINES: dict[str, type[Mechanics]] = {"mujoco": Mujoco, "tree": FrameTree}
