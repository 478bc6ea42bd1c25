"""A tool, and the TOML file that states it: segments from the holder to the tip, what holds each.

    name = "end mill, 12 mm"
    to_spindle = [0.0, 0.0, -1.0]   # from the tip to the spindle, in the axes of the FRFs

    [material.carbide]
    youngs_modulus_pa = 5.4e11
    density_kg_m3 = 14500.0
    poisson_ratio = 0.25
    loss_factor = 0.001             # structural damping

    [[segment]]                     # the shank
    material = "carbide"
    length_m = 0.030
    diameter_m = 0.012
    [segment.contact]               # what holds it at its lower end; none: held rigidly
    stiffness_n_m = 4.5e7
    stiffness_nm_rad = 4.2e6
    damping_ns_m = 210.0
    damping_nms_rad = 1.5

    [[segment]]                     # the flutes, bending like a rod of 80 % of their diameter
    material = "carbide"
    length_m = 0.026
    diameter_m = 0.012
    flutes = 4

Further keys of a segment: `end_diameter_m` (towards the tip), `bore_m`, `equivalent_diameter_m`
of flutes, `mass_kg` at its end towards the tip. `[[point]]` says where a tested tool was hit and
measured: `node` in the FRFs' file, `from_tip_m`, `place_sd_m`, `sensor_mass_kg`. `to_spindle` is
the direction that cut.toml calls `axis`; the `axis` of older tool files, from the holder to the
tip, still means that.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np

from planner.errors import InputError
from planner.milling.beam import Segment, ToolContact, ToolMaterial, transfer
from planner.toml_file import load_toml

NUMBERS = ("stiffness_n_m", "stiffness_nm_rad", "damping_ns_m", "damping_nms_rad")


SAME_PLACE = 1e-9  # m


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
    """Segments from the holder to the tip, the unit axis (3,) from holder to tip, measured points.

    The axis is that along which parts follow each other; files say where the spindle is, the other
    way.
    """

    name: str
    axis: tuple[float, float, float]
    parts: tuple[Segment, ...]
    points: tuple[Point, ...] = ()
    says_spindle: bool = False  # whether its file has to_spindle, which older ones have not

    @property
    def length(self) -> float:
        """In m."""
        return sum(part.length for part in self.parts)

    @property
    def frame(self) -> np.ndarray:
        """(3, 3): columns are the tool's own x, y, z in the axes of the FRFs."""
        return frame_along(np.array(self.axis))

    def transfer(self, omega: np.ndarray) -> np.ndarray:
        """(F, 12, 12) of the state from the tip to below the lowest contact; omega in rad/s."""
        return transfer(self.parts, omega)

    def above(self, from_tip: float) -> "Tool":
        """The part of it between the tip and a section so many m away."""
        own = _cut(self.parts, from_tip)[1]
        # What holds the lowest is below the section.
        return replace(self, parts=(*(replace(part, contact=None) for part in own[:1]), *own[1:]))

    def contacts(self) -> list[tuple[int, ToolContact]]:
        """Contacts, and the number of the part that each holds."""
        return [(k, p.contact) for k, p in enumerate(self.parts) if p.contact is not None]

    def held(self, number: int, contact: ToolContact) -> "Tool":
        """The same with another contact below a part."""
        parts = list(self.parts)
        parts[number] = replace(parts[number], contact=contact)
        return replace(self, parts=tuple(parts))

    @property
    def sd_away(self) -> "list[Tool]":
        """The same with one number of one contact an sd away, for each whose sd is stated."""
        return [
            self.held(number, contact.scaled(name, 1 + contact.sd_percent / 100))
            for number, contact in self.contacts()
            for name in (NUMBERS if contact.sd_percent > 0 else ())
        ]


def frame_along(axis: np.ndarray) -> np.ndarray:
    """(3, 3): columns are the axes of a frame whose z is along an axis (3,)."""
    z = axis / np.linalg.norm(axis)
    first = np.eye(3)[0] if abs(z[0]) < 0.9 else np.eye(3)[1]
    x = first - z * (z @ first)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


Parts = tuple[Segment, ...]


def _cut(parts: Parts, from_tip: float) -> tuple[Parts, Parts]:
    """Parts on the holder's side of a section so many m from the tip, and on the tip's side."""
    for k in range(len(parts) - 1, -1, -1):
        s = parts[k]
        if from_tip <= SAME_PLACE:
            return parts[: k + 1], parts[k + 1 :]
        if from_tip < s.length - SAME_PLACE:
            width = s.end_diameter + from_tip / s.length * (s.diameter - s.end_diameter)
            below = replace(s, length=s.length - from_tip, end_diameter=width, mass=0.0)
            above = replace(s, length=from_tip, diameter=width, contact=None)
            return (*parts[:k], below), (above, *parts[k + 1 :])
        from_tip -= s.length
    return (), parts


def loaded(parts: Parts, from_tip: float, mass: float) -> Parts:
    """Parts with a mass (kg) so many m from the tip; at the very lowest end it is the holder's."""
    below, above = _cut(parts, from_tip)
    heavier = (replace(part, mass=part.mass + mass) for part in below[-1:])
    return (*below[:-1], *heavier, *above)


# Of the cutting diameter, as which flutes bend (Kops and Vo, CIRP Annals 39, 1990).
FLUTED = 0.8
TO_TIP = (0.0, 0.0, 1.0)  # where a file says nothing: z of the tcp points out of the tool


class SegmentTable(msgspec.Struct, forbid_unknown_fields=True):
    """Segments from the holder to the tip, each a beam of a `material`.

    `end_diameter_m` is towards the tip, `bore_m` along the axis; of `flutes` the segment bends as a
    rod of 80 % of its diameter, or of `equivalent_diameter_m`; `mass_kg` sits at its end.
    """

    length_m: float
    diameter_m: float
    material: str
    end_diameter_m: float | None = None
    bore_m: float = 0.0
    flutes: int = 0
    equivalent_diameter_m: float | None = None
    mass_kg: float = 0.0
    contact: ToolContact | None = None

    @property
    def ends(self) -> tuple[float, float]:
        """Diameters in m, at the holder's side and the tip's."""
        end = self.end_diameter_m
        return self.diameter_m, self.diameter_m if end is None else end

    @property
    def bending(self) -> tuple[float, float]:
        """Those of the rod as which it bends."""
        if self.equivalent_diameter_m is not None:
            return self.equivalent_diameter_m, self.equivalent_diameter_m
        factor = FLUTED if self.flutes else 1.0
        return factor * self.ends[0], factor * self.ends[1]


class ToolTable(msgspec.Struct, forbid_unknown_fields=True):
    """A tool, segment by segment from the holder to the tip.

    `to_spindle` is the direction from the tip to the spindle, in the axes of the FRFs: what
    cut.toml calls `axis`. `axis` may state the direction from the holder to the tip instead.
    """

    segment: tuple[SegmentTable, ...]
    material: dict[str, ToolMaterial]
    name: str = ""
    to_spindle: tuple[float, float, float] | None = None
    axis: tuple[float, float, float] | None = None
    point: tuple[Point, ...] = ()


def load_tool(path: Path) -> Tool:
    """A tool from its TOML file; InputError naming the file, the fault and the remedy."""
    table = load_toml(path, ToolTable, "tool.toml")
    _check(path, table)
    parts = tuple(
        Segment(s.length_m, *s.bending, table.material[s.material], s.bore_m, s.mass_kg, s.contact)
        for s in table.segment
    )
    points = tuple(msgspec.structs.replace(p, node=str(p.node)) for p in table.point)
    stated = table.to_spindle is not None
    to_tip = -np.array(table.to_spindle) if stated else np.array(table.axis or TO_TIP)
    x, y, z = (float(a) for a in to_tip / np.linalg.norm(to_tip))
    tool = Tool(table.name or path.stem, (x, y, z), parts, points, stated)
    for point in points:
        if point.from_tip_m > tool.length:
            raise InputError(
                f"{path}: node {point.node} is {point.from_tip_m} m from the tip of a tool that is "
                f"{tool.length:g} m long; correct from_tip_m."
            )
        if point.sensor_mass_kg > 0:
            parts = loaded(tool.parts, point.from_tip_m, point.sensor_mass_kg)
            tool = replace(tool, parts=parts)
    return tool


def _check(path: Path, table: ToolTable) -> None:
    if not table.segment:
        raise InputError(f"{path} has no [[segment]]; list them from the holder to the tip.")
    if table.to_spindle is not None and table.axis is not None:
        raise InputError(
            f"{path}: to_spindle and axis, which older files have from the holder to the tip, both "
            f"say where the tool points; leave axis out."
        )
    for name in ("to_spindle", "axis"):
        given = getattr(table, name)
        if given is not None and not np.linalg.norm(given) > 0:
            raise InputError(
                f"{path}: {name} has no direction; write to_spindle, from the tip to the spindle."
            )
    for name, m in table.material.items():
        where = f"{path}, material {name}"
        _check_signs(where, m, ("youngs_modulus_pa", "density_kg_m3"), ("loss_factor",))
        if not -1 < m.poisson_ratio < 0.5:
            raise InputError(f"{where}: poisson_ratio is {m.poisson_ratio:g}; correct it.")
    for number, s in enumerate(table.segment, 1):
        _check_segment(f"{path}, segment {number}", s, table.material)
    for number, p in enumerate(table.point, 1):
        signed = "from_tip_m", "place_sd_m", "sensor_mass_kg"
        _check_signs(f"{path}, point {number}", p, (), signed)
    if len({str(p.node) for p in table.point}) < len(table.point):
        raise InputError(f"{path} lists a [[point]] with the same node twice; correct node.")


def _check_segment(where: str, s: SegmentTable, materials: dict[str, ToolMaterial]) -> None:
    if s.material not in materials:
        raise InputError(
            f"{where} is of {s.material!r}, which has no [material.{s.material}]; add that."
        )
    lengths = "length_m", "diameter_m", "end_diameter_m", "equivalent_diameter_m"
    _check_signs(where, s, lengths, ("bore_m", "mass_kg", "flutes"))
    if s.bore_m >= min(*s.ends, *s.bending):
        raise InputError(f"{where}: a bore of {s.bore_m} m leaves nothing of it; correct bore_m.")
    if s.contact is not None:
        _check_signs(f"{where}, contact", s.contact, NUMBERS[:2], (*NUMBERS[2:], "sd_percent"))


def _check_signs(
    where: str, table: msgspec.Struct, positive: Sequence[str], others: Sequence[str]
) -> None:
    """InputError for the first stated entry that is not above zero, or of the others below it."""
    for name in (*positive, *others):
        value = getattr(table, name)
        if value is None or 0 < value < np.inf or (value == 0 and name in others):
            continue
        said = "has to be above zero" if name in positive else "cannot be negative"
        raise InputError(f"{where}: {name} is {value:g}; it {said}, correct it.")
