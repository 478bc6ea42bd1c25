"""How a true robot deviates from its robot folder: scatter, and linear physics left out."""

from dataclasses import dataclass

import numpy as np

Vector = tuple[float, float, float]


def triple(values: np.ndarray) -> Vector:
    """The numbers of a vector (3,)."""
    x, y, z = (float(v) for v in values)
    return x, y, z


@dataclass(frozen=True)
class Spring:
    """An elastic rotation about `axis`, or with `slide` an elastic shift along it.

    It sits after `joint`; between floor and robot if that is "base"; half-way to the next joint
    if it is a link's name. Stiffness in N·m/rad (N/m), damping in N·m·s/rad (N·s/m); the axis is
    in the joint's child frame, or the link's (for the base: the world's). `loss`: a loss factor
    beside the viscous damping, nearly the same from LOSS_BAND_HZ's lower to its upper end.
    """

    joint: str
    axis: Vector
    stiffness: float
    damping: float
    slide: bool = False
    loss: float = 0.0


def soft_floor(about_x: float, about_y: float, damping_s: float = 3e-4) -> tuple[Spring, ...]:
    """The base on a floor that gives way: two tilts, of so many N·m/rad."""
    tilts: tuple[tuple[Vector, float], ...] = ((1.0, 0.0, 0.0), about_x), ((0.0, 1.0, 0.0), about_y)
    return tuple(Spring("base", axis, k, damping_s * k) for axis, k in tilts)


@dataclass(frozen=True)
class BentLink:
    """A link as a beam of `elements` lumped elements: it bends about two axes and twists.

    Compliances are those of the whole link, as springs half-way would have them: `bending` about
    two directions across it and `torsion` along it in N·m/rad; damping = damping_s · stiffness.
    """

    link: str
    bending: tuple[float, float]
    torsion: float
    damping_s: float
    elements: int = 5


@dataclass(frozen=True)
class Compensator:
    """A gas spring beside a joint, from a point on one link to one on the next.

    Its length is l² = a² + b² - 2ab cos(q + offset) with `arm_m` a and `base_m` b, its force
    `force_n` + `stiffness` (N/m) · (l - a); what counts is how its torque changes with the angle.
    """

    joint: str
    arm_m: float
    base_m: float
    offset_rad: float
    force_n: float
    stiffness: float


@dataclass(frozen=True)
class Bridge:
    """A cable or hose from a point of one link to one of another: spring and damper along a line.

    Positions in m in the links' frames, direction in the world's; N/m and N·s/m.
    """

    links: tuple[str, str]
    positions_m: tuple[Vector, Vector]
    direction: Vector
    stiffness: float
    damping: float


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
    """Stiffness of a joint about its own axis, times 1 + c cos(n q) + s sin(n q).

    `by`: the joint whose angle q is; its own if that is empty.
    """

    joint: str
    order: int
    cosine: float
    sine: float
    by: str = ""


@dataclass(frozen=True)
class Feedback:
    """A controller that breaks reciprocity: a torque on `driven`, -gain (N·m/rad) × `sensed`.

    Both are joints; the twists are those about their own axes.
    """

    driven: str
    sensed: str
    gain: float


@dataclass(frozen=True)
class ServoLoop:
    """A controller that gives way slowly: `share` more of a joint's stiffness above a corner."""

    joint: str
    share: float
    corner_hz: float


@dataclass(frozen=True)
class Deviation:
    """How truth differs from the robot folder: seeded scatter, and what the simulation lacks.

    `stiffness`, `damping` and `inertia` are relative standard deviations, `com_m` one in m.
    All stated springs have `common` times their stiffness. Shares from 0 to 1, drawn for each, of
    `mixed` times their damping are a loss factor's instead. `spin` (N·m·s) is the angular momentum
    of a spindle along the tcp's z axis.
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
    common: float = 1.0
    mixed: float = 0.0
    beams: tuple[BentLink, ...] = ()
    compensators: tuple[Compensator, ...] = ()
    bridges: tuple[Bridge, ...] = ()
    servos: tuple[ServoLoop, ...] = ()
    spin: float = 0.0
