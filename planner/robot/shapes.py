"""Shapes of a URDF's links that can be used, the sizes of their boxes, and which were left out."""

import hashlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

from planner.robot.mesh_files import find_mesh
from planner.robot.urdf import quiet
from planner.robot.urdf_elements import Links, numbers, place_of

LARGEST_M = 1e4  # of a shape
FEW = 3  # names in a sentence
SIZES = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",)}
KEPT = 256  # meshes at hand


@dataclass(frozen=True)
class UnusableShape:
    """A shape that cannot be used: of which link, of which kind, and why not."""

    link: str
    kind: str  # "collision" or "visual"
    why: str


def leave_out_unusable(links: Links, urdf: Path) -> tuple[UnusableShape, ...]:
    """Name the files of all meshes in full; remove shapes without a file or a size."""
    return _leave_out(links, ("collision", "visual"), lambda part: _fault(part, urdf))


def leave_out_unreadable(links: Links) -> tuple[UnusableShape, ...]:
    """Remove collision shapes whose mesh cannot be read."""
    return _leave_out(links, ("collision",), _unreadable)


def _leave_out(
    links: Links, kinds: Sequence[str], fault: Callable[[ElementTree.Element], str]
) -> tuple[UnusableShape, ...]:
    """Remove the links' shapes of these kinds that have a fault."""
    found = []
    for name, link in links.items():
        for part in [part for kind in kinds for part in link.findall(kind)]:
            if why := fault(part):
                link.remove(part)
                found.append(UnusableShape(name, part.tag, why))
    return tuple(found)


def _unreadable(part: ElementTree.Element) -> str:
    mesh = part.find("geometry/mesh")
    if mesh is None or load_mesh(mesh) is not None:
        return ""
    return f"{mesh.get('filename', '')} is no mesh that can be read"


def shapes_of(link: ElementTree.Element, kind: str) -> list[tuple[pin.SE3, coal.CollisionGeometry]]:
    """Shapes of a kind, "collision" or "visual", that can be used; where they are in the link."""
    each = ((place_of(part), _shape(part)) for part in link.findall(kind))
    return [(place, shape) for place, shape in each if shape is not None]


def build_geometry(model: pin.Model, links: Links) -> pin.GeometryModel:
    """Collision shapes that can be used."""
    geometry = pin.GeometryModel()
    for name, link in links.items():
        number = model.getFrameId(name, pin.FrameType.BODY)
        frame = model.frames[number]
        for k, (place, shape) in enumerate(shapes_of(link, "collision")):
            at = frame.parentJoint, number, frame.placement * place
            geometry.addGeometryObject(pin.GeometryObject(f"{name}_{k}", *at, shape))
    return geometry


def unchecked_sentence(left: Sequence[UnusableShape]) -> str:
    """Which links are not, or not wholly, checked for collision, and why; "" where none is."""
    left = [one for one in left if one.kind == "collision"]
    if not left:
        return ""
    links = list(dict.fromkeys(one.link for one in left))
    reasons = list(dict.fromkeys(one.why for one in left))
    more = f", and {len(reasons) - FEW} more" if len(reasons) > FEW else ""
    shapes = "A collision shape is" if len(left) == 1 else f"{len(left)} collision shapes are"
    return (
        f"{shapes} left out ({'; '.join(reasons[:FEW])}{more}): {', '.join(links)} "
        f"{'is' if len(links) == 1 else 'are'} not, or not wholly, checked for collision."
    )


def shape_corners(links: Links) -> dict[str, list[np.ndarray]]:
    """Corners (3,) of boxes around the shapes of each link, in its frame, eight each.

    Collision shapes; visual ones where a link has no others. Meshes are named in full.
    """
    found: dict[str, list[np.ndarray]] = {}
    for name, link in links.items():
        corners = found.setdefault(name, [])
        kind = "visual" if link.find("collision") is None else "collision"
        for place, shape in shapes_of(link, kind):
            shape.computeLocalAABB()
            low, high = np.array(shape.aabb_local.min_), np.array(shape.aabb_local.max_)
            corners += [place.act(np.where(s, high, low)) for s in np.ndindex(2, 2, 2)]
    return found


def load_mesh(mesh: ElementTree.Element) -> coal.BVHModelBase | None:
    """A <mesh> whose file is named in full, to scale, in m; None where it cannot be read."""
    file, scale = Path(mesh.get("filename", "")), numbers(mesh.get("scale", "1 1 1"))
    try:
        digest = hashlib.sha256(file.read_bytes()).digest()
    except OSError:
        return None
    return _read(file, digest, tuple(scale.tolist()))


@lru_cache(maxsize=KEPT)
def _read(file: Path, digest: bytes, scale: tuple[float, ...]) -> coal.BVHModelBase | None:
    """Read again where what the file holds, by its `digest`, is other than before."""
    with quiet():
        try:
            mesh = coal.MeshLoader().load(str(file), np.array(scale))
        except (ValueError, RuntimeError):
            return None
    if not isinstance(mesh, coal.BVHModelBase) or not mesh.num_tris:
        return None
    mesh.computeLocalAABB()
    return mesh


def _shape(part: ElementTree.Element) -> coal.CollisionGeometry | None:
    shape = part.find("geometry/*")
    if shape is None:
        return None
    if shape.tag == "mesh":
        return load_mesh(shape)
    if shape.tag == "box":
        return coal.Box(*numbers(shape.get("size", "")))
    radius = float(shape.get("radius", "0"))
    if shape.tag == "cylinder":
        return coal.Cylinder(radius, float(shape.get("length", "0")))
    return coal.Sphere(radius)


def _fault(part: ElementTree.Element, urdf: Path) -> str:
    """Why a shape cannot be used, "" where it can; names a mesh's file in full."""
    shape = part.find("geometry/*")
    if shape is None:
        return "it has no geometry"
    if shape.tag == "mesh":
        name = shape.get("filename", "")
        file, scale = find_mesh(urdf, name), numbers(shape.get("scale", "1 1 1"))
        if file is None:
            return f"{name or 'a mesh without a name'} cannot be found"
        shape.set("filename", str(file))
        return "" if scale.shape == (3,) and np.all(np.abs(scale) > 0) else "its scale is 0"
    sizes = numbers(" ".join(shape.get(key, "") for key in SIZES.get(shape.tag, ())))
    if not sizes.size or not np.all((sizes > 0) & (sizes < LARGEST_M)):
        return f"a {shape.tag} of size {', '.join(f'{v:g}' for v in sizes) or 'unknown'}"
    return ""
