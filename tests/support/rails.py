"""Robots with joints that slide: a small arm of two joints on a rail, and a gantry with a wrist."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.proof import descriptions

Place = tuple[float, float, float]
# Small enough never to collide; nothing is drawn.
COLLIDES = '<collision><geometry><box size="0.08 0.08 0.08"/></geometry></collision>'


@dataclass(frozen=True)
class Axis:
    """A joint: name, place in its parent (m), axis, limits; its link, its spring; speed, type.

    The link has mass in kg, centre in m; stiffness is about or along the axis, in N·m/rad or N/m.
    """

    name: str
    place: Place
    axis: Place
    limits: tuple[float, float]
    mass: float
    centre: Place
    stiffness: float
    speed: float = 2.0
    kind: str = "revolute"


SLIDES = "prismatic"
RAIL_ARM = (
    Axis("rail", (0, 0, 0.2), (0, 1, 0), (-0.2, 2.0), 14.0, (0, 0, 0.1), 2.2e5, 1.0, SLIDES),
    Axis("turn", (0.05, 0, 0.3), (0, 0, 1), (-2.8, 2.8), 8.0, (0.2, 0.02, 0.05), 1.1e4),
    Axis("lift", (0.45, 0, 0.1), (0, 1, 0), (-1.6, 1.6), 5.0, (0.2, 0.01, 0.02), 5.0e3),
)
RAIL_BOX = ((0.0, 1500.0), (-70.0, 70.0), (-60.0, 60.0))

GANTRY = (
    Axis("x", (0, 0, 2), (1, 0, 0), (0.0, 3.0), 90.0, (0, 0.1, 0), 3.0e6, 1.0, SLIDES),
    Axis("y", (0, 0, 0), (0, 1, 0), (-1.0, 1.0), 40.0, (0.05, 0, 0), 2.0e6, 1.0, SLIDES),
    Axis("z", (0.1, 0, 0), (0, 0, -1), (0.0, 0.9), 25.0, (0, 0.02, -0.3), 4.0e6, 0.5, SLIDES),
    Axis("a", (0, 0.05, -0.6), (0, 0, 1), (-3.0, 3.0), 9.0, (0.05, 0.06, -0.1), 1.2e4),
    Axis("b", (0, 0, -0.2), (0, 1, 0), (-1.8, 1.8), 6.0, (0.03, 0, -0.12), 9.0e3),
)
GANTRY_BOX = ((200.0, 2800.0), (-800.0, 800.0), (100.0, 800.0), (-120.0, 120.0), (-80.0, 80.0))


def urdf(axes: tuple[Axis, ...], tip: Place) -> str:
    """The URDF; `tip` is where the tcp is in the last link."""
    parts, parent = [descriptions.link("base_link")], "base_link"
    for one in axes:
        moments, child = one.mass * np.array([0.02, 0.024, 0.014]), f"{one.name}_link"
        inertial = descriptions.inertial(one.mass, one.centre, moments)
        names = one.name, parent, child
        where = one.place, one.axis, one.limits
        parts.append(descriptions.link(child, inertial, COLLIDES))
        parts.append(descriptions.joint(*names, *where, one.speed, kind=one.kind))
        parent = child
    parts.append(descriptions.frame("tcp", parent, tip, (0, 0.4, 0.3)))
    return descriptions.urdf("sliding", parts)


def make_sliding(
    folder: Path, axes: tuple[Axis, ...] = RAIL_ARM, tip: Place = (0.4, 0.04, 0.05), said: str = ""
) -> Path:
    """Write the robot folder; returns robot.toml."""
    lines = descriptions.head("sliding", "robot.urdf", "tcp", "tcp", (3.0, 60.0), said)
    for one in axes:
        axis, slides = [float(v) for v in one.axis], one.kind == SLIDES
        lines.append(descriptions.compliance(one.name, axis, one.stiffness, 5e-4, slides))
    return descriptions.write_robot(folder, "robot.urdf", urdf(axes, tip), lines)


def sliding_campaign(path: Path, box: tuple[tuple[float, float], ...] = RAIL_BOX) -> Path:
    """Write a campaign.toml over the joint box; returns its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    more = 'name = "integrated_variance"\ncandidates = 40\n'
    path.write_text(descriptions.campaign(box, 3, (3.0, 60.0), more))
    return path
