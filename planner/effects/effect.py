"""What a simulation can lack, as an operator on the dynamic stiffness at a place.

Everything that a new effect must give stands in `Operator`; adding one touches its own file and
`table`. An effect frees springs that robot.toml does not state (`springs`), or adds an impedance
with numbers ψ of its own, each with a normal prior, or both.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

from planner.dynamics.gradient import Impedance
from planner.dynamics.motion import times_real


class Gain(Protocol):
    """What columns gain beside all else, to first order."""

    def __call__(
        self, columns: np.ndarray, sd: np.ndarray, poses: slice = slice(None)
    ) -> list[tuple[float, np.ndarray]]:
        """Nats and the likeliest ψ (k,) of each k columns.

        `columns` (n, … · k, r, c, F) are changes of H at those `poses`, of prior sds (k,); at
        others there are none.
        """
        ...


@dataclass(frozen=True)
class Number:
    """One of an effect's own numbers: normal about `mean`; where it is `log`, its logarithm is."""

    name: str
    unit: str
    mean: float
    sd: float
    log: bool = False

    def value(self, psi: float) -> float:
        """In its unit."""
        return float(np.exp(psi)) if self.log else float(psi)


@dataclass(frozen=True, eq=False)
class PosedBodies:
    """Poses q (n, dof) in rad at s (n, F), and how e springs move bodies, (n, B, 6, e).

    `springs` (e,) are the numbers of the springs among all that the robot may have; `order` (n,) is
    how much of the campaign was over, 0 to 1, when each pose was hit; joints read `readback`
    (n, dof) and stood at q.
    """

    q: np.ndarray
    s: np.ndarray
    jacobians: np.ndarray
    bodies: tuple[str, ...]
    springs: tuple[int, ...]
    order: np.ndarray
    readback: np.ndarray

    def body(self, joint: str) -> np.ndarray:
        """(n, 6, e): how the springs move what turns with a joint, linear part first."""
        return self.jacobians[:, self.bodies.index(joint)]

    def carried(self, joint: str, place: np.ndarray) -> np.ndarray:
        """(n, 3, e): how they move a point at `place` (3,) in m of the joint's frame."""
        moved = self.body(joint)
        return moved[:, :3] + np.tensordot(place, ACROSS, 1) @ moved[:, 3:]


# (3, 3, 3): what turns with a link at w moves what lies at e_v by ACROSS[v] w = w × e_v.
ACROSS = np.array([np.cross(np.eye(3), e).T for e in np.eye(3)])


# Values and sds of an effect's springs and numbers, by name, in their units.
Values = Mapping[str, tuple[float, float]]


@dataclass(frozen=True, eq=False)
class Motions:
    """How hits (n, e, c, F) and sensors (n, e, r, F) move the springs, per unit of force.

    `accelerance` (n, r, c, F) is what the fit so far has, `measured` what was recorded;
    `by_angle` (n, dof, r, c, F) how the former changes with the joints' angles, if that is known.
    """

    poses: PosedBodies
    x_hit: np.ndarray
    x_sensor: np.ndarray
    accelerance: np.ndarray
    measured: np.ndarray
    by_angle: np.ndarray | None = None

    def of(self, some: slice) -> "Motions":
        """Of some of the poses."""
        p = self.poses
        each = (p.q, p.s, p.jacobians, p.order, p.readback)
        q, s, jacobians, order, readback = (values[some] for values in each)
        poses = PosedBodies(q, s, jacobians, p.bodies, p.springs, order, readback)
        angles = None if self.by_angle is None else self.by_angle[some]
        fields = self.x_hit, self.x_sensor, self.accelerance, self.measured
        x_hit, x_sensor, accelerance, measured = (values[some] for values in fields)
        return Motions(poses, x_hit, x_sensor, accelerance, measured, angles)

    def at(self, ports: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Motions (n, p, c, F) and (n, p, r, F) of ports (n, p, e)."""
        return times_real(ports, self.x_hit), times_real(ports, self.x_sensor)

    def changed_by(self, added: Impedance) -> np.ndarray:
        """(n, p, r, c, F): how accelerances change with each number of what is added to Z."""
        minus = -(self.poses.s**2)[:, None, None]
        shape = (len(minus), len(added.slope), self.x_sensor.shape[2], self.x_hit.shape[2])
        columns = np.empty((*shape, minus.shape[3]), dtype=complex)
        added.gradient(self.x_hit * minus, self.x_sensor, columns)
        return columns


@dataclass(frozen=True, eq=False)
class Start:
    """An effect, ψ where a fit begins with it, and the nats that the first order promises."""

    effect: "Operator"
    psi: np.ndarray
    gain_nats: float


def gain_of(start: Start) -> float:
    """What the first order promises."""
    return start.gain_nats


@dataclass(frozen=True)
class SpringPrior:
    """Of ln k: normal `shift` above the usual median, with sd `log_sd`; not below `least`, which
    counts from that median too."""

    shift: float
    log_sd: float
    least: float = -np.inf


@dataclass(frozen=True)
class Operator(ABC):
    """One thing that the simulation may lack, at a place ("base", "joint_2", "link_3")."""

    at: str
    springs: tuple[int, ...] = ()
    numbers: tuple[Number, ...] = ()

    kind: ClassVar[str] = ""
    effect: ClassVar[str] = ""  # by which name diagnoses tell of it, where that is not its kind
    # Whether refitting the robot takes its place, so that it counts by evidence and not by size.
    absorbed: ClassVar[bool] = False
    # Of the measuring chain: no physics, and prediction does without it.
    artefact: ClassVar[bool] = False
    # Has freedom enough to imitate what the shape of a named effect lacks: where it is, not what.
    general: ClassVar[bool] = False
    # robot.toml states it: it stays, and is not told of.
    stated: ClassVar[bool] = False
    # Several may be at the same place.
    several: ClassVar[bool] = False

    @property
    def label(self) -> str:
        """ "local_resonator at link_3"."""
        return f"{self.kind} at {self.at}"

    @property
    def name(self) -> tuple[str, str]:
        """What it is called, and where: ("base_compliance", "base")."""
        return self.effect or self.kind, self.at.split("#")[0]

    @property
    def more_than_springs(self) -> bool:
        """Whether it is more than its springs."""
        return bool(self.springs and self.numbers)

    @property
    def springs_only(self) -> bool:
        """Whether it is nothing but springs."""
        return bool(self.springs) and not self.numbers

    @property
    def mean(self) -> np.ndarray:
        """Prior mean of ψ."""
        return np.array([n.mean for n in self.numbers])

    @property
    def sd(self) -> np.ndarray:
        """Prior sd of ψ."""
        return np.array([n.sd for n in self.numbers])

    def impedance(self, poses: PosedBodies, psi: np.ndarray) -> Impedance | None:
        """What it adds to the dynamic stiffness beside its springs, with slopes by ψ."""
        return None

    def stood_off(self, q: np.ndarray, psi: np.ndarray) -> np.ndarray | None:
        """(n, dof) in rad or m: by how much joints stood beside their readback q (n, dof)."""
        return None

    def chain(self, s: np.ndarray, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Factor (n or 1, 3, 3, F or 1) of what each sensor hears, and its slopes (p, …) by ψ."""
        return None

    @property
    def levers(self) -> tuple[tuple[int, int, float], ...]:
        """Springs whose turning shifts others: numbers of slide and turn, and the sign by which the
        last of ψ, in m, tells how far per radian."""
        return ()

    @property
    def spring_priors(self) -> Mapping[int, SpringPrior]:
        """What is known of springs where this effect is, other than without it, by their numbers.

        Of effects on the same spring the last counts.
        """
        return {}

    def starts(self, motions: Motions, gain: Gain) -> tuple[Start, ...]:
        """Where fits with it begin, by its first-order columns; springs are tried as they are."""
        return (Start(self, self.mean, np.inf),)

    def moved_to(self, found: "Operator", psi: np.ndarray, motions: Motions, gain: Gain) -> Start:
        """Where it begins, as `found`, one like it at another place, has ψ."""
        return self.starts(motions, gain)[0]

    def of_matter(self, inertia: np.ndarray) -> np.ndarray | None:
        """ψ at which it adds this inertia (10,) to its body; None where it can't."""
        return None

    def beside(self, psi: np.ndarray) -> tuple[np.ndarray, ...]:
        """Where fits may begin as well as at ψ."""
        return ()

    @property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest ψ that there can be."""
        return np.full(len(self.numbers), -np.inf), np.full(len(self.numbers), np.inf)

    def vanishing(self, psi: np.ndarray) -> np.ndarray:
        """Changes of the first numbers of ψ at which it is no more, to first order."""
        return np.zeros(0)

    def inertia(self, psi: np.ndarray) -> tuple[str, np.ndarray, np.ndarray] | None:
        """The body whose inertia it changes, where it is nothing else, by what (10,), and the
        slopes (numbers, 10) of that by ψ."""
        return None

    def beyond(self, psi: np.ndarray, viscous: Mapping[int, float]) -> bool:
        """Whether what every robot has is so much that it is worth a word.

        `viscous` are the loss factors of springs' dampers in the middle of the band, by number.
        """
        return False

    def taken(self, psi: np.ndarray) -> dict[int, float]:
        """By how much in N·m/rad it lessens springs where that is most, by their numbers."""
        return {}

    def losses(self, psi: np.ndarray) -> dict[int, float]:
        """Loss factors that it gives springs, by their numbers."""
        return {}

    def parameters(
        self, values: Mapping[str, tuple[float, float]]
    ) -> dict[str, tuple[float, float, str]]:
        """Values, sds and units of its springs and numbers, by name."""
        units = {n.name: n.unit for n in self.numbers}
        spring = {True: "N/m", False: "N·m/rad"}
        return {n: (*v, units.get(n) or spring[" along " in n]) for n, v in values.items()}

    @abstractmethod
    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """What it is, for whoever stands at the robot; values and sds by name."""

    def same_thing(self, mine: Values, others: Values) -> bool:
        """Whether it is one thing with another of its kind at its place, by both values."""
        return False

    def words_together(self, each: Sequence[Values]) -> str:
        """What all those are that are one thing (`same_thing`)."""
        return self.words(each[0])

    def tables(self, values: Mapping[str, tuple[float, float]]) -> dict[str, list[dict[str, Any]]]:
        """Blocks of robot.toml that state it, beside its springs'."""
        return {}


def moving(shape: np.ndarray) -> np.ndarray:
    """(6, 6): a shape (3, 3) of velocities alone."""
    out = np.zeros((6, 6))
    out[:3, :3] = shape
    return out


def turning(shape: np.ndarray) -> np.ndarray:
    """(6, 6): a shape (3, 3) between velocities and rates of turn, and its transpose."""
    out = np.zeros((6, 6))
    out[:3, 3:], out[3:, :3] = shape, shape.T
    return out
