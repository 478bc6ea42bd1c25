"""A robot as makers publish it: a ROS package whose URDF names meshes and may lack much else."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from planner.proof import descriptions

PACKAGE = "arm_description"
# Per link: corners of the box that its mesh is, in the link's frame, in m; the base first.
BOXES = [
    ((-0.2, -0.2, 0.0), (0.2, 0.2, 0.28)),
    ((-0.1, -0.15, 0.0), (0.25, 0.15, 0.27)),
    ((-0.1, -0.1, 0.0), (0.1, 0.1, 0.72)),
    ((-0.1, -0.08, -0.06), (0.44, 0.08, 0.1)),
    ((0.45, -0.05, -0.05), (0.7, 0.05, 0.05)),
    ((-0.04, -0.04, -0.04), (0.08, 0.04, 0.04)),
    ((0.0, -0.03, -0.03), (0.03, 0.03, 0.03)),
]
PLACES = [(0, 0, 0.3), (0.1, 0, 0.3), (0, 0, 0.7), (0, 0, 0.04), (0.75, 0, 0), (0.1, 0, 0)]
AXES = [(0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0)]
LIMITS = [(-2.9, 2.9), (-1.5, 2.0), (-2.2, 1.4), (-3.0, 3.0), (-2.0, 2.0), (-6.0, 6.0)]
DENSITY = 900.0  # kg/m³ of the boxes, where inertias are stated
RAIL = (
    '<link name="rail"/><joint name="rail_joint" type="prismatic"><parent link="rail"/>'
    '<child link="base_link"/><axis xyz="0 1 0"/>'
    '<limit lower="-1" upper="2" velocity="1" effort="0"/></joint>'
)
HAND = "".join(
    f'<link name="finger_{side}"/><joint name="finger_joint_{side}" type="prismatic">'
    f'<parent link="tool0"/><child link="finger_{side}"/><axis xyz="0 {sign} 0"/>'
    f'<limit lower="0" upper="0.04" velocity="1" effort="0"/></joint>'
    for side, sign in (("left", 1), ("right", -1))
)


def write_box(path: Path, low: Sequence[float], high: Sequence[float]) -> None:
    """A closed box as an STL file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    corners = np.array([np.where(bits, high, low) for bits in np.ndindex(2, 2, 2)])
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    lines = ["solid box"]
    for a, b, c, d in faces:
        for triangle in ((a, b, c), (a, c, d)):
            points = (" ".join(f"{v:.6f}" for v in corners[k]) for k in triangle)
            lines += ["facet normal 0 0 0", "outer loop", *(f"vertex {p}" for p in points)]
            lines += ["endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid box"]))


def inertial(box: tuple[Sequence[float], Sequence[float]]) -> str:
    """<inertial> of a full box."""
    low, high = map(np.array, box)
    size, centre = high - low, (low + high) / 2
    mass = DENSITY * float(np.prod(size))
    return descriptions.inertial(mass, centre, mass / 12 * (size @ size - size**2))


def published(
    folder: Path, *, inertias: bool = False, package: str = PACKAGE, more: str = ""
) -> Path:
    """Write folder/package/{urdf,meshes}; returns the URDF's path. `more` is further XML."""
    parts, root = [], folder / package
    for number, box in enumerate(BOXES):
        name = f"link_{number}" if number else "base_link"
        write_box(root / "meshes" / f"{name}.stl", *box)
        mesh = f'<geometry><mesh filename="package://{PACKAGE}/meshes/{name}.stl"/></geometry>'
        shapes = f"<visual>{mesh}</visual><collision>{mesh}</collision>"
        parts.append(descriptions.link(name, inertial(box) if inertias else "", shapes))
    rows = zip(PLACES, AXES, LIMITS, strict=True)
    for number, (place, axis, limits) in enumerate(rows, 1):
        parent = f"link_{number - 1}" if number > 1 else "base_link"
        names = f"joint_{number}", parent, f"link_{number}"
        parts.append(descriptions.joint(*names, place, axis, limits))
    parts.append(descriptions.frame("tool0", "link_6", (0.03, 0, 0), (0, 1.5707963, 0)))
    urdf = root / "urdf" / "arm.urdf"
    urdf.parent.mkdir(parents=True, exist_ok=True)
    urdf.write_text(descriptions.urdf("published", [*parts, more]))
    return urdf


def robot_toml(path: Path, urdf: Path, more: str = "") -> Path:
    """A robot.toml with a spring a joint for a URDF of `published`; returns its path."""
    lines = descriptions.head("p", str(urdf), "tool0", "tool0", (5.0, 90.0))
    springs = zip(AXES, [1e6, 1e6, 4e5, 5e4, 5e4, 2e4], strict=True)
    for number, (axis, k) in enumerate(springs, 1):
        lines.append(descriptions.compliance(f"joint_{number}", axis, k, 2e-4))
    path.write_text("\n".join([*lines, more]))
    return path
