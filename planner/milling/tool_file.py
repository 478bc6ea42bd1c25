"""A tool as a TOML file states it: segments from the holder to the tip, materials, contacts.

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

import re
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np

from planner.errors import InputError
from planner.milling.beam import Segment, ToolMaterial
from planner.milling.tool import Point, Tool, ToolContact, ToolPart, loaded
from planner.toml_file import load_toml

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
    try:
        table = load_toml(path, ToolTable, "tool.toml")
    except InputError as error:
        raise InputError(_with_unit(path, str(error), str(error.__cause__))) from None
    _check(path, table)
    parts = tuple(_part(s, table.material[s.material]) for s in table.segment)
    points = tuple(msgspec.structs.replace(p, node=str(p.node)) for p in table.point)
    tool = Tool(
        table.name or path.stem, _to_tip(table), parts, points, table.to_spindle is not None
    )
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


def _to_tip(table: ToolTable) -> tuple[float, float, float]:
    """Unit vector from the holder to the tip."""
    given = table.axis or TO_TIP
    if table.to_spindle is not None:
        given = -np.array(table.to_spindle)
    x, y, z = (float(a) for a in np.array(given) / np.linalg.norm(given))
    return x, y, z


def _part(s: SegmentTable, material: ToolMaterial) -> ToolPart:
    end = s.diameter_m if s.end_diameter_m is None else s.end_diameter_m
    start = s.diameter_m
    if s.flutes:
        start, end = FLUTED * start, FLUTED * end
    if s.equivalent_diameter_m is not None:
        start = end = s.equivalent_diameter_m
    return ToolPart(Segment(s.length_m, start, end, material, s.bore_m, s.mass_kg), s.contact)


UNITS = {
    "length": "length_m", "diameter": "diameter_m", "end_diameter": "end_diameter_m",
    "bore": "bore_m", "mass": "mass_kg", "density": "density_kg_m3", "from_tip": "from_tip_m",
    "youngs_modulus": "youngs_modulus_pa", "stiffness": "stiffness_n_m and stiffness_nm_rad",
    "damping": "damping_ns_m and damping_nms_rad", "place_sd": "place_sd_m",
    "equivalent_diameter": "equivalent_diameter_m", "sensor_mass": "sensor_mass_kg",
}  # fmt: skip


def _with_unit(path: Path, sentence: str, fault: str) -> str:
    """The `fault` in words where a key only lacks its unit, or has another one."""
    found = re.search(r"unknown field `(\w+)`(?:.*at `([^`]+)`)?", fault)
    if found is None:
        return sentence
    key, place = found.group(1), (found.group(2) or "").removeprefix("$.")
    stem = max((s for s in UNITS if key == s or key.startswith(f"{s}_")), key=len, default=None)
    if stem is None:
        return sentence
    where = f"{path}, {place}" if place else str(path)
    return f"{where}: {key} does not state the unit that is read here; write {UNITS[stem]}."


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
        _positive(where, youngs_modulus_pa=m.youngs_modulus_pa, density_kg_m3=m.density_kg_m3)
        _not_negative(where, loss_factor=m.loss_factor)
        if not -1 < m.poisson_ratio < 0.5:
            raise InputError(f"{where}: poisson_ratio is {m.poisson_ratio:g}; correct it.")
    for number, s in enumerate(table.segment, 1):
        _check_segment(f"{path}, segment {number}", s, table.material)
    for number, p in enumerate(table.point, 1):
        _not_negative(
            f"{path}, point {number}",
            from_tip_m=p.from_tip_m, place_sd_m=p.place_sd_m, sensor_mass_kg=p.sensor_mass_kg,
        )  # fmt: skip
    if len({str(p.node) for p in table.point}) < len(table.point):
        raise InputError(f"{path} lists a [[point]] with the same node twice; correct node.")


def _check_segment(where: str, s: SegmentTable, materials: dict[str, ToolMaterial]) -> None:
    if s.material not in materials:
        raise InputError(
            f"{where} is of {s.material!r}, which has no [material.{s.material}]; add that."
        )
    end = s.diameter_m if s.end_diameter_m is None else s.end_diameter_m
    _positive(where, length_m=s.length_m, diameter_m=s.diameter_m, end_diameter_m=end)
    _not_negative(where, bore_m=s.bore_m, mass_kg=s.mass_kg, flutes=s.flutes)
    if s.equivalent_diameter_m is not None:
        _positive(where, equivalent_diameter_m=s.equivalent_diameter_m)
    narrow = min(s.diameter_m, end, s.equivalent_diameter_m or np.inf)
    if s.bore_m >= narrow * (FLUTED if s.flutes and s.equivalent_diameter_m is None else 1.0):
        raise InputError(f"{where}: a bore of {s.bore_m} m leaves nothing of it; correct bore_m.")
    if s.contact is not None:
        c = s.contact
        _positive(f"{where}, contact", stiffness_n_m=c.stiffness_n_m,
                  stiffness_nm_rad=c.stiffness_nm_rad)  # fmt: skip
        _not_negative(f"{where}, contact", damping_ns_m=c.damping_ns_m,
                      damping_nms_rad=c.damping_nms_rad, sd_percent=c.sd_percent)  # fmt: skip


def _positive(where: str, **values: float) -> None:
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"{where}: {name} is {value:g}; it has to be above zero, correct it.")


def _not_negative(where: str, **values: float) -> None:
    for name, value in values.items():
        if not (np.isfinite(value) and value >= 0):
            raise InputError(f"{where}: {name} is {value:g}; it cannot be negative, correct it.")
