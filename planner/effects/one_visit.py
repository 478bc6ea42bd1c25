"""What was otherwise at one of the poses measured: a joint's angle, the tool, what touched it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import ClassVar

import numpy as np

from planner.dynamics.gradient import Impedance
from planner.effects.added_mass import AddedMass
from planner.effects.effect import Gain, Motions, Number, Operator, PosedBodies, Start
from planner.effects.links import GroundContact
from planner.recording.joints import SCALES
from planner.robot.robot import Robot
from planner.words import with_sd

MISREAD = 0.1, 0.05  # sd: rad of a joint that turns, m of one that slides; a mistyped digit


@dataclass(frozen=True)
class OfOneVisit(Operator):
    """At the pose stated as `q` (dof,) in rad or m alone."""

    q: tuple[float, ...] = ()
    pose: str = ""

    artefact = True
    other_robot: ClassVar[bool] = False  # what was measured there is not of the robot elsewhere

    def _among(self, q: np.ndarray) -> slice:
        """Where its pose is; nowhere in other data."""
        same = np.all(q == np.array(self.q), axis=1)
        row = int(np.argmax(same))
        return slice(row, row + int(same[row]))


@dataclass(frozen=True)
class MisreadAngle(OfOneVisit):
    """A joint, number `number` from 0, stood elsewhere than its readback says."""

    joint: str = ""
    number: int = 0
    slides: bool = False

    kind = "misread_angle"

    def stood_off(self, q: np.ndarray, psi: np.ndarray) -> np.ndarray:
        """(n, dof) in rad or m: by how much joints stood beside their readback q (n, dof)."""
        off = np.zeros(q.shape)
        off[self._among(q), self.number] = psi[0]
        return off

    def starts(self, motions: Motions, gain: Gain) -> tuple[Start, ...]:
        """By its column."""
        assert motions.by_angle is not None
        here = self._among(motions.poses.readback)
        [(nats, psi)] = gain(motions.by_angle[here, self.number, None], self.sd, here)
        return (Start(self, psi, nats),)

    def vanishing(self, psi: np.ndarray) -> np.ndarray:
        """See `Operator.vanishing`."""
        return -psi

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        scale, unit = (SCALES["mm"], " mm") if self.slides else (SCALES["deg"], "°")
        stated = scale * self.q[self.number]
        off, sd = (scale * v for v in values["angle"])
        return (
            f"At {self.pose} {self.joint} stood at {with_sd(stated + off, sd)}{unit}, not at "
            f"{stated:.2f}{unit} as stated: look it up. If it was misread, withdraw {self.pose}, "
            f"correct the angle in its recordings.csv, and import its hits again with --pose "
            f"{self.pose}b."
        )


@dataclass(frozen=True)
class OtherImpedance(OfOneVisit):
    """Something on the last link that was not there at the other poses."""

    other_robot = True

    def impedance(self, poses: PosedBodies, psi: np.ndarray) -> Impedance:
        """Of its pose."""
        every, here = super().impedance(poses, psi), self._among(poses.readback)
        assert every is not None
        ports = np.zeros_like(every.ports)
        ports[here] = every.ports[here]
        return replace(every, ports=ports)

    def starts(self, motions: Motions, gain: Gain) -> tuple[Start, ...]:
        """By its columns at its pose."""
        here = self._among(motions.poses.readback)

        def of_pose(columns: np.ndarray, sd: np.ndarray, poses: slice = here):
            return gain(columns, sd, poses)

        return super().starts(motions.of(here), of_pose)

    def moved_to(self, found: Operator, psi: np.ndarray, motions: Motions, gain: Gain) -> Start:
        """See `Operator.moved_to`."""
        return self.starts(motions, gain)[0]

    def inertia(self, psi: np.ndarray) -> None:
        """At other poses it has none."""


@dataclass(frozen=True)
class OtherTool(OtherImpedance, AddedMass):
    """Another tool, or a load that hung on it."""

    kind = "other_tool"
    absorbed = False

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        mass, sd, _ = self.parameters(values)["mass"]
        more = "more" if mass > 0 else "less"
        return (
            f"At {self.pose} the last link carried {with_sd(abs(mass), sd)} kg {more} than at the "
            f"other poses: was the tool changed, or did something hang on it? If so, withdraw "
            f"{self.pose} and hit it again with the tool of the others."
        )


@dataclass(frozen=True)
class Touched(OtherImpedance, GroundContact):
    """The last link was held."""

    kind = "touched"
    general = False

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        return (
            f"At {self.pose} something held or touched the last link, a fixture, a part, a cable: "
            f"look there; withdraw {self.pose} and hit it again when the link is free."
        )


def of_one_visit(
    robot: Robot, q: np.ndarray, poses: Sequence[str], effects: Iterable[Operator]
) -> tuple[OfOneVisit, ...]:
    """Every joint at every pose q (n, dof) in rad or m, by the poses' names, and what may have been
    otherwise on the last link that `effects` have; it is touched where hits go."""
    joints, tip = robot.joints, robot.model.frames[robot.tcp_id].placement.translation
    found: list[OfOneVisit] = []
    # Of links from the base on: the last is what carries the tool.
    last = {OtherTool if isinstance(e, AddedMass) else Touched: e for e in effects
            if isinstance(e, AddedMass | GroundContact)}  # fmt: skip
    for pose, row in zip(poses, q.tolist(), strict=True):
        for k, (name, slides) in enumerate(zip(joints.names, joints.slides, strict=True)):
            number = Number("angle", "m" if slides else "rad", 0.0, MISREAD[slides])
            at = f"joint_{k + 1} of {pose}"
            found.append(MisreadAngle(at, (), (number,), tuple(row), pose, name, k, slides))
        for kind, effect in last.items():
            given = {f.name: getattr(effect, f.name) for f in fields(effect)}
            given |= {"at": f"{effect.at} of {pose}", "q": tuple(row), "pose": pose}
            given |= {"place_m": tuple(tip.tolist())} if kind is Touched else {}
            found.append(kind(**given))
    return tuple(found)
