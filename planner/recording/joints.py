"""How files, answers and screens state where joints stand: degrees, and millimetres of slides.

Inside all is in rad and m. This is the one place where one becomes the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import msgspec
import numpy as np
from numpy.typing import ArrayLike

# Readbacks of one pose differ by less, and poses worth measuring by more: chosen.
SAME_DEG, SAME_MM = 0.5, 5.0
MM = 1e3  # a metre
# Of coordinates in rad and m, by the unit in which tables state them.
SCALES = {"deg": 180 / np.pi, "mm": MM}


@dataclass(frozen=True)
class AxisColumn:
    """A table's column of a joint, whose numbers are sign · the joint's + offset (deg or mm)."""

    name: str
    sign: float = 1.0
    offset: float = 0.0

    def stated(self, value: float) -> float:
        """The joint's own number of one in the column."""
        return self.sign * (value - self.offset)


@dataclass(frozen=True)
class JointUnits:
    """Names of a robot's joints in order, and which of them slide (prismatic) and do not turn.

    "Stated" numbers are degrees of joints that turn, millimetres of those that slide. `axes` are
    the joints' columns in tables that count as the robot's controller does; () where none is known.
    """

    names: tuple[str, ...]
    slides: tuple[bool, ...]
    axes: tuple[AxisColumn, ...] = field(default=(), compare=False)

    @classmethod
    def of(cls, joints: "JointUnits | Sequence[str]") -> "JointUnits":
        """Names alone are those of joints that turn."""
        if isinstance(joints, JointUnits):
            return joints
        return cls(tuple(joints), (False,) * len(joints))

    @classmethod
    def declared_as(
        cls, names: Sequence[str], units: Sequence[str] | np.ndarray | msgspec.UnsetType
    ) -> "JointUnits":
        """Of names, and of what was `declared` with them."""
        if isinstance(units, msgspec.UnsetType):
            return cls.of(names)
        return cls(tuple(names), tuple(unit == "mm" for unit in units))

    @cached_property
    def units(self) -> tuple[str, ...]:
        """ "deg" or "mm" of each joint."""
        return tuple("mm" if slide else "deg" for slide in self.slides)

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Names of the joints' columns in tables: "joint_1_deg", "rail_mm"."""
        return tuple(f"{name}_{unit}" for name, unit in zip(self.names, self.units, strict=True))

    @cached_property
    def headings(self) -> tuple[str, ...]:
        """The same for people: "joint_1 (°)", "rail (mm)"."""
        signs = ("mm" if slide else "°" for slide in self.slides)
        return tuple(f"{name} ({sign})" for name, sign in zip(self.names, signs, strict=True))

    @property
    def declared(self) -> tuple[str, ...] | msgspec.UnsetType:
        """What answers and the log say beside stated numbers; unset where all joints turn."""
        return self.units if any(self.slides) else msgspec.UNSET

    def shown(self, q: ArrayLike) -> np.ndarray:
        """Stated numbers of q (..., dof) in rad or m."""
        q = np.asarray(q, dtype=float)
        some = any(self.slides) and q.size > 0
        return np.where(self.slides, MM * q, np.rad2deg(q)) if some else np.rad2deg(q)

    def internal(self, stated: ArrayLike) -> np.ndarray:
        """(..., dof) in rad or m of stated numbers."""
        given = np.asarray(stated, dtype=float)
        turned = np.deg2rad(given)
        some = any(self.slides) and given.size > 0
        return np.where(self.slides, given / MM, turned) if some else turned

    def text(self, joint: int, stated: float, digits: int = 1) -> str:
        """A stated number of one joint with its unit: "30.0°", "1200.0 mm"."""
        return f"{stated:.{digits}f}{' mm' if self.slides[joint] else '°'}"

    def listed(self, stated: Sequence[float] | np.ndarray, digits: int = 1) -> str:
        """All stated numbers of a pose, for a sentence: "10.0, 20.0°", "1200.0 mm, 20.0°"."""
        if not any(self.slides):
            return ", ".join(f"{value:.{digits}f}" for value in stated) + "°"
        return ", ".join(self.text(joint, value, digits) for joint, value in enumerate(stated))

    def same(self) -> np.ndarray:
        """(dof,) stated numbers by which readbacks of one pose may differ."""
        return np.where(self.slides, SAME_MM, SAME_DEG)

    def apart(self, one: Sequence[float], other: Sequence[float]) -> str:
        """By how much two stated poses differ at most, in words; "" where they are the same."""
        off = np.abs(np.subtract(one, other))
        worst = int(np.argmax(off / self.same()))
        return self.text(worst, float(off[worst]), 2) if off[worst] > self.same()[worst] else ""
