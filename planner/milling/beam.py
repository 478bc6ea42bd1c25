"""Timoshenko beams of stepped or tapered round sections, as transfer matrices.

The state at a section is motion (x, y, z, θx, θy, θz) in m and rad, and what the part towards the
tip exerts on the part towards the holder there: force in N and moment in N·m, along the tool's own
axes, z from the holder to the tip. Along a segment the state obeys a linear differential equation
(Timoshenko 1921; bending in two planes, stretching, twisting), whose solution from the tip to the
holder is a matrix exponential: exact for a uniform segment, of fourth order (Magnus 1954; Blanes
et al., Phys. Rep. 470, 2009) in the slices of a tapered one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, reduce

import msgspec
import numpy as np
from scipy.linalg import expm

SLICES = 24  # of a tapered segment: one that narrows to less than half is then exact to 1e-5
GAUSS = np.sqrt(3) / 6  # places of Gauss's two points on a slice, from its middle


class ToolMaterial(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A material by a name of your choice; `loss_factor` is its structural damping."""

    youngs_modulus_pa: float
    density_kg_m3: float
    poisson_ratio: float
    loss_factor: float = 0.0

    @property
    def modulus(self) -> complex:
        """E (1 + iη)."""
        return self.youngs_modulus_pa * (1 + 1j * self.loss_factor)

    @property
    def shear_modulus(self) -> complex:
        """G (1 + iη)."""
        return self.modulus / (2 * (1 + self.poisson_ratio))


# Places of the motions that a contact lets slip: across the axis, and turning about that.
ACROSS, TURNING = (0, 1), (3, 4)


class ToolContact(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What holds a segment at its lower end; without it the segment is held rigidly.

    Stiffness and damping are across the axis and in bending; `sd_percent` says how well known.
    """

    stiffness_n_m: float
    stiffness_nm_rad: float
    damping_ns_m: float = 0.0
    damping_nms_rad: float = 0.0
    sd_percent: float = 0.0

    def transfer(self, omega: np.ndarray) -> np.ndarray:
        """(F, 12, 12) of the state from the tip's side to the holder's; omega (F,) in rad/s.

        Its sides move apart by its flexibility for each unit of force or moment.
        """
        out = np.zeros((len(omega), 12, 12), complex)
        out[:, range(12), range(12)] = 1
        for places, stiffness, damping in (
            (ACROSS, self.stiffness_n_m, self.damping_ns_m),
            (TURNING, self.stiffness_nm_rad, self.damping_nms_rad),
        ):
            for k in places:
                out[:, k, 6 + k] = -1 / (stiffness + 1j * omega * damping)
        return out

    def scaled(self, name: str, factor: float) -> "ToolContact":
        """The same with one of its four numbers multiplied."""
        return msgspec.structs.replace(self, **{name: factor * getattr(self, name)})


@dataclass(frozen=True)
class Segment:
    """A piece of a round beam: length and diameters in m, at its holder's side and its tip's side.

    `bore` is the diameter of a hole along it; `mass` (kg) sits at its end towards the tip;
    `contact` holds it at its holder's side (None: rigidly).
    """

    length: float
    diameter: float
    end_diameter: float
    material: ToolMaterial
    bore: float = 0.0
    mass: float = 0.0
    contact: ToolContact | None = None

    def at(self, place: float) -> "Section":
        """The section at a share of the length, 0 at the holder's side."""
        return Section(
            self.diameter + place * (self.end_diameter - self.diameter), self.bore, self.material
        )


@dataclass(frozen=True)
class Section:
    """A round section, outer and inner diameter in m."""

    diameter: float
    bore: float
    material: ToolMaterial

    @property
    def area(self) -> float:
        """In m²."""
        return np.pi / 4 * (self.diameter**2 - self.bore**2)

    @property
    def second_moment(self) -> float:
        """Of area about a diameter, in m⁴; twice that about the axis."""
        return np.pi / 64 * (self.diameter**4 - self.bore**4)

    @property
    def shear_coefficient(self) -> float:
        """Cowper's for a hollow circle (J. Appl. Mech. 33, 1966)."""
        nu, m2 = self.material.poisson_ratio, (self.bore / self.diameter) ** 2
        ring = (1 + m2) ** 2
        return 6 * (1 + nu) * ring / ((7 + 6 * nu) * ring + (20 + 12 * nu) * m2)

    @property
    def slope(self) -> tuple[np.ndarray, np.ndarray]:
        """(12, 12) of which the first + ω² times the second is how the state changes, tipwards."""
        m, area, second = self.material, self.area, self.second_moment
        shear, bending = self.shear_coefficient * m.shear_modulus * area, m.modulus * second
        twisting, k = 2 * m.shear_modulus * second, np.arange(6)
        still, moving = np.zeros((12, 12), complex), np.zeros((12, 12))
        still[k, 6 + k] = 1 / np.array([shear, shear, m.modulus * area, bending, bending, twisting])
        # A section that turns moves the next one across, and a force across turns it.
        still[0, 4], still[1, 3], still[10, 6], still[9, 7] = 1, -1, -1, 1
        moving[6 + k, k] = -m.density_kg_m3 * np.array([area] * 3 + [second, second, 2 * second])
        return still, moving


# Which of the twelve numbers of a state belong together. In the second plane a rotation about −x
# does what one about y does in the first.
FIRST_PLANE, SECOND_PLANE, AXIAL, TORSION = (0, 4, 6, 10), (1, 3, 7, 9), (2, 8), (5, 11)
TURNED = np.outer((1.0, -1.0, 1.0, -1.0), (1.0, -1.0, 1.0, -1.0))


def transfer(segments: Sequence[Segment], omega: np.ndarray) -> np.ndarray:
    """(F, 12, 12) from the state at the tip to below the lowest contact, of segments holder first.

    omega (F,) in rad/s, > 0.
    """
    total = np.broadcast_to(np.eye(12, dtype=complex), (len(omega), 12, 12))
    omega = np.ascontiguousarray(omega, float)
    for segment in segments[::-1]:
        total = _segment(replace(segment, contact=None), omega.tobytes()) @ total
        if segment.contact is not None:
            total = segment.contact.transfer(omega) @ total
    return total


@lru_cache(maxsize=8)  # a contact is identified with the same segments again and again
def _segment(segment: Segment, lines: bytes) -> np.ndarray:
    omega = np.frombuffer(lines)
    out, each = np.zeros((len(omega), 12, 12), complex), range(len(omega))
    for part in (FIRST_PLANE, AXIAL, TORSION):
        out[np.ix_(each, part, part)] = found = _along(segment, omega, part)
        if part == FIRST_PLANE:
            out[np.ix_(each, SECOND_PLANE, SECOND_PLANE)] = TURNED * found
    # The mass at its tip's side: motion there takes a force.
    out[:, :, :3] += segment.mass * (omega**2)[:, None, None] * out[:, :, 6:9]
    return out


def _along(segment: Segment, omega: np.ndarray, part: tuple[int, ...]) -> np.ndarray:
    """From the tip's side of a segment to its holder's: the exponential of −slope·length."""

    def slope(place: float) -> np.ndarray:
        still, moving = (each[np.ix_(part, part)] for each in segment.at(place).slope)
        return still + moving * (omega**2)[:, None, None]

    if segment.end_diameter == segment.diameter:
        return expm(-segment.length * slope(0.0))
    step, middle = segment.length / SLICES, (np.arange(SLICES) + 0.5) / SLICES
    near, far = (
        np.array([slope(place + side * GAUSS / SLICES) for place in middle]) for side in (-1, 1)
    )
    # Run towards the holder, the far point comes first.
    bracket = near @ far - far @ near
    slices = expm(-step / 2 * (near + far) + step**2 * np.sqrt(3) / 12 * bracket)
    return reduce(np.matmul, slices)
