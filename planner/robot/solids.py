"""Bodies of even density that fill the shapes of a URDF's links."""

import xml.etree.ElementTree as ElementTree

import coal
import numpy as np
import pinocchio as pin

from planner.robot.robot import Robot
from planner.robot.shapes import build_geometry


def link_solids(robot: Robot) -> dict[str, pin.Inertia]:
    """Inertia of each link at a density of 1 kg/m³, in its own frame; links without shapes lack.

    Of collision shapes, or of visual ones where a link has no others. Of a mesh its convex hull is
    filled: hardly any published mesh closes, and volumes of those that do not mean nothing.
    """
    root = ElementTree.fromstring(robot.urdf_text)
    found: dict[str, pin.Inertia] = {}
    for kind in ("collision", "visual"):
        for link in root.findall("link"):  # visual meshes are large, and read where needed alone
            if kind == "visual" and link.get("name", "") in found:
                for part in link.findall(kind):
                    link.remove(part)
        for name, solid in _solids(robot, root, kind):
            found[name] = found[name] + solid if name in found else solid
    return found


def _solids(robot: Robot, root: ElementTree.Element, kind: str) -> list[tuple[str, pin.Inertia]]:
    geometry = build_geometry(robot.model, root, kind)
    found = []
    for shape in geometry.geometryObjects:
        frame = robot.model.frames[shape.parentFrame]
        solid = _solid(shape.geometry)
        if solid is not None:
            place = frame.placement.inverse() * shape.placement
            found.append((str(frame.name), place.act(solid)))
    return found


def _solid(shape: coal.CollisionGeometry) -> pin.Inertia | None:
    """Of one shape in its own frame; None where it has no volume."""
    if isinstance(shape, coal.BVHModelBase):
        return hull_solid(np.array(shape.vertices()))
    volume = shape.computeVolume()
    if not volume > 0:
        return None
    return pin.Inertia(volume, shape.computeCOM(), shape.computeMomentofInertiaRelatedToCOM())


def hull_solid(points: np.ndarray) -> pin.Inertia | None:
    """The convex hull of points (n, 3) in m, filled with 1 kg/m³; None where it is flat."""
    from scipy.spatial import ConvexHull, QhullError  # 0.2 s

    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return None
    inside = points[hull.vertices].mean(axis=0)
    # Tetrahedra from a point inside to each face: their second moments by their corners.
    corners = points[hull.simplices] - inside
    volume = np.abs(np.linalg.det(corners)) / 6
    total = volume.sum()
    sums = corners.sum(axis=1)
    centre = volume @ sums / 4 / total
    outer = np.einsum("t,tki,tkj->ij", volume, corners, corners)
    second = (outer + np.einsum("t,ti,tj->ij", volume, sums, sums)) / 20
    second -= total * np.outer(centre, centre)
    return pin.Inertia(float(total), inside + centre, np.trace(second) * np.eye(3) - second)
