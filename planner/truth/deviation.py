"""How a true robot deviates from what its folder says."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Spring:
    """An elastic rotation: after `joint` ("base": between floor and robot) about `axis`.

    Stiffness in N·m/rad, damping in N·m·s/rad; the axis is in the joint's child frame (for the
    base: the world's).
    """

    joint: str
    axis: tuple[float, float, float]
    stiffness: float
    damping: float


@dataclass(frozen=True)
class AddedMass:
    """A compact mass (kg) on a link, at a position (m) in the link's frame."""

    link: str
    position_m: tuple[float, float, float]
    mass_kg: float


@dataclass(frozen=True)
class Deviation:
    """How truth differs from the robot folder: seeded scatter, and what the simulation lacks.

    `stiffness` and `inertia` are relative standard deviations, `com_m` one in m.
    """

    seed: int = 0
    stiffness: float = 0.0
    damping: float = 0.0
    inertia: float = 0.0
    com_m: float = 0.0
    extra: tuple[Spring, ...] = ()
    added: tuple[AddedMass, ...] = ()
