"""How a true robot deviates from its robot folder: scatter, and linear physics left out."""

from dataclasses import dataclass

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Spring:
    """An elastic rotation about `axis`, or with `slide` an elastic shift along it.

    It sits after `joint`; between floor and robot if that is "base"; half-way to the next joint
    if it is a link's name. Stiffness in N·m/rad (N/m), damping in N·m·s/rad (N·s/m); the axis is
    in the joint's child frame, or the link's (for the base: the world's).
    """

    joint: str
    axis: Vector
    stiffness: float
    damping: float
    slide: bool = False


@dataclass(frozen=True)
class AttachedMass:
    """A compact mass (kg) on a link, at a position (m) in the link's frame."""

    link: str
    position_m: Vector
    mass_kg: float


@dataclass(frozen=True)
class AttachedResonator:
    """A small mass (kg) on a spring of its own, at a position (m) and along a direction of a link.

    `frequency_hz` and `damping_ratio` are those that it has on a link that is held.
    """

    link: str
    position_m: Vector
    direction: Vector
    mass_kg: float
    frequency_hz: float
    damping_ratio: float


@dataclass(frozen=True)
class ScaledJoint:
    """Stiffness and damping of a joint about its own axis, times a factor."""

    joint: str
    factor: float


@dataclass(frozen=True)
class StiffnessRipple:
    """Stiffness of a joint about its own axis, times 1 + c cos(n q) + s sin(n q)."""

    joint: str
    order: int
    cosine: float
    sine: float


@dataclass(frozen=True)
class Feedback:
    """A controller that breaks reciprocity: a torque on `driven`, -gain (N·m/rad) × `sensed`.

    Both are joints; the twists are those about their own axes.
    """

    driven: str
    sensed: str
    gain: float


@dataclass(frozen=True)
class Deviation:
    """How truth differs from the robot folder: seeded scatter, and what the simulation lacks.

    `stiffness`, `damping` and `inertia` are relative standard deviations, `com_m` one in m.
    """

    seed: int = 0
    stiffness: float = 0.0
    damping: float = 0.0
    inertia: float = 0.0
    com_m: float = 0.0
    extra: tuple[Spring, ...] = ()
    added: tuple[AttachedMass, ...] = ()
    resonators: tuple[AttachedResonator, ...] = ()
    scaled: tuple[ScaledJoint, ...] = ()
    harmonics: tuple[StiffnessRipple, ...] = ()
    feedback: tuple[Feedback, ...] = ()
