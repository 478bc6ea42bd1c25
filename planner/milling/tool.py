"""A tool: segments from the holder to the tip, what holds each, and where it was measured."""

from dataclasses import dataclass, replace

import msgspec
import numpy as np

from planner.milling.beam import Segment, transfer

# Places of the motions that a contact lets slip: across the axis, and turning about that.
ACROSS, TURNING = (0, 1), (3, 4)
NUMBERS = ("stiffness_n_m", "stiffness_nm_rad", "damping_ns_m", "damping_nms_rad")


class ToolContact(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What holds a segment at its lower end; without it the segment is held rigidly.

    Stiffness and damping are across the axis and in bending; `sd_percent` says how well known.
    """

    stiffness_n_m: float
    stiffness_nm_rad: float
    damping_ns_m: float = 0.0
    damping_nms_rad: float = 0.0
    sd_percent: float = 0.0

    def flexibility(self, omega: np.ndarray) -> np.ndarray:
        """(F, 6): how far its sides move apart, for each unit of force or moment."""
        out = np.zeros((len(omega), 6), complex)
        out[:, ACROSS] = 1 / (self.stiffness_n_m + 1j * omega * self.damping_ns_m)[:, None]
        out[:, TURNING] = 1 / (self.stiffness_nm_rad + 1j * omega * self.damping_nms_rad)[:, None]
        return out

    def transfer(self, omega: np.ndarray) -> np.ndarray:
        """(F, 12, 12) of the state from the tip's side to the holder's; omega (F,) in rad/s."""
        out = np.zeros((len(omega), 12, 12), complex)
        out[:, range(12), range(12)] = 1
        out[:, range(6), range(6, 12)] = -self.flexibility(omega)
        return out

    def scaled(self, name: str, factor: float) -> "ToolContact":
        """The same with one of its four numbers multiplied."""
        return msgspec.structs.replace(self, **{name: factor * getattr(self, name)})


SAME_PLACE = 1e-9  # m


@dataclass(frozen=True)
class ToolPart:
    """A segment, and the contact that holds it at its holder's side; None: rigidly."""

    segment: Segment
    contact: ToolContact | None = None


class Point(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where a tested tool was hit and measured: the `node` of the FRFs' file, from its tip.

    `place_sd_m` says how well that is known, `sensor_mass_kg` what sat there.
    """

    node: int | str
    from_tip_m: float
    place_sd_m: float = 0.0
    sensor_mass_kg: float = 0.0


@dataclass(frozen=True)
class Tool:
    """Parts from the holder to the tip, the unit axis (3,) from holder to tip, measured points.

    The axis is that along which parts follow each other; files say where the spindle is, the other
    way.
    """

    name: str
    axis: tuple[float, float, float]
    parts: tuple[ToolPart, ...]
    points: tuple[Point, ...] = ()
    says_spindle: bool = False  # whether its file has to_spindle, which older ones have not

    @property
    def length(self) -> float:
        """In m."""
        return sum(part.segment.length for part in self.parts)

    @property
    def mass(self) -> float:
        """In kg."""
        return sum(part.segment.weight for part in self.parts)

    @property
    def frame(self) -> np.ndarray:
        """(3, 3): columns are the tool's own x, y, z in the axes of the FRFs."""
        z = np.array(self.axis)
        first = np.eye(3)[0] if abs(z[0]) < 0.9 else np.eye(3)[1]
        x = first - z * (z @ first)
        x /= np.linalg.norm(x)
        return np.column_stack([x, np.cross(z, x), z])

    def transfer(self, omega: np.ndarray) -> np.ndarray:
        """(F, 12, 12) of the state from the tip to below the lowest contact; omega in rad/s."""
        total = np.broadcast_to(np.eye(12, dtype=complex), (len(omega), 12, 12))
        for part in self.parts[::-1]:
            total = transfer([part.segment], omega) @ total
            if part.contact is not None:
                total = part.contact.transfer(omega) @ total
        return total

    def above(self, from_tip: float) -> "Tool":
        """The part of it between the tip and a section so many m away."""
        parts = _split(self.parts, from_tip)
        length, kept = 0.0, 0
        while kept < len(parts) and length < from_tip - SAME_PLACE:
            kept += 1
            length += parts[-kept].segment.length
        own = [replace(p) for p in parts[len(parts) - kept :]]
        if own:  # what holds the lowest is below the section
            own[0] = replace(own[0], contact=None)
        return replace(self, parts=tuple(own))

    def contacts(self) -> list[tuple[int, ToolContact]]:
        """Contacts, and the number of the part that each holds."""
        return [(k, p.contact) for k, p in enumerate(self.parts) if p.contact is not None]

    def held(self, number: int, contact: ToolContact) -> "Tool":
        """The same with another contact below a part."""
        parts = list(self.parts)
        parts[number] = replace(parts[number], contact=contact)
        return replace(self, parts=tuple(parts))


def _split(parts: tuple[ToolPart, ...], from_tip: float) -> tuple[ToolPart, ...]:
    """Parts with an end so many m from the tip."""
    out, left = list(parts), from_tip
    for k in range(len(parts) - 1, -1, -1):
        s = parts[k].segment
        if left <= SAME_PLACE:
            break
        if left < s.length - SAME_PLACE:
            width = s.end_diameter + left / s.length * (s.diameter - s.end_diameter)
            below = replace(s, length=s.length - left, end_diameter=width, mass=0.0)
            above = replace(s, length=left, diameter=width)
            out[k : k + 1] = [replace(parts[k], segment=below), ToolPart(above)]
            break
        left -= s.length
    return tuple(out)


def loaded(parts: tuple[ToolPart, ...], from_tip: float, mass: float) -> tuple[ToolPart, ...]:
    """Parts with a mass (kg) so many m from the tip."""
    parts, length = _split(parts, from_tip), 0.0
    for k in range(len(parts) - 1, -1, -1):
        if abs(length - from_tip) < 10 * SAME_PLACE:
            segment = replace(parts[k].segment, mass=parts[k].segment.mass + mass)
            return (*parts[:k], replace(parts[k], segment=segment), *parts[k + 1 :])
        length += parts[k].segment.length
    return parts  # at the very lowest end: the holder's, not the tool's
