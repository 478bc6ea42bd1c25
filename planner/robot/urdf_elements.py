"""Elements of a URDF's XML: numbers, places, axes, limits, inertias."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence

import numpy as np
import pinocchio as pin

from planner.robot.config import STATED, LinkTable, symmetric

TURNING, SLIDING = ("revolute", "continuous"), ("prismatic",)
ENTRIES = dict(zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), STATED, strict=True))

Joints = Links = Mapping[str, ElementTree.Element]  # by name


def links_of(root: ElementTree.Element) -> Links:
    """The links of a URDF."""
    return {link.get("name", "?"): link for link in root.findall("link")}


def placed(position_m: Sequence[float], rpy_deg: Sequence[float]) -> pin.SE3:
    """A place as robot.toml states it."""
    return pin.SE3(pin.rpy.rpyToMatrix(*np.deg2rad(rpy_deg)), np.array(position_m, dtype=float))


def numbers(text: str) -> np.ndarray:
    """Numbers of an attribute, three NaN where it holds anything else."""
    try:
        return np.array([float(v) for v in text.split()])
    except ValueError:
        return np.full(3, np.nan)


def vector(parent: ElementTree.Element, tag: str, key: str, default: str = "0 0 0") -> np.ndarray:
    """Three numbers (3,) of an element's child, NaN where it states anything else."""
    child = parent.find(tag)
    found = numbers(default if child is None else child.get(key, default))
    return found if found.shape == (3,) else np.full(3, np.nan)


def place_of(element: ElementTree.Element) -> pin.SE3:
    """Where an element's <origin> is in what carries it."""
    turn = pin.rpy.rpyToMatrix(vector(element, "origin", "rpy"))
    return pin.SE3(turn, vector(element, "origin", "xyz"))


def joint_axis(joint: ElementTree.Element) -> np.ndarray:
    """Unit axis (3,) of a joint in its own frame; NaN where there is none."""
    axis = vector(joint, "axis", "xyz", "1 0 0")
    size = np.linalg.norm(axis)
    return axis / size if 1e-6 < size < np.inf else np.full(3, np.nan)


def limits_of(joint: ElementTree.Element) -> tuple[float, float] | None:
    """A joint's own limits; None where it states none: 0 to 0 is what is left out."""
    limit = joint.find("limit")
    if limit is None or joint.get("type") == "continuous":
        return None
    low, high = (float(numbers(limit.get(key, "0"))[0]) for key in ("lower", "upper"))
    return (low, high) if low < high else None


def replace_child(parent: ElementTree.Element, tag: str, **attributes: str) -> None:
    """Leave an element one child of a tag, with these attributes; none without any."""
    for old in parent.findall(tag):
        parent.remove(old)
    if attributes:
        ElementTree.SubElement(parent, tag, attributes)


def link_inertia(link: ElementTree.Element) -> pin.Inertia:
    """Of a link in its own frame; 0 where the URDF states none."""
    inertial = link.find("inertial")
    if inertial is None:
        return pin.Inertia.Zero()
    mass, entries = inertial.find("mass"), inertial.find("inertia")
    stated = {} if entries is None else entries.attrib
    moments = symmetric([float(stated.get(k, "0")) for k in ENTRIES])
    place = place_of(inertial)
    turned = place.rotation @ moments @ place.rotation.T
    value = 0.0 if mass is None else float(mass.get("value", "0"))
    return pin.Inertia(value, place.translation, turned)


def write_inertia(link: ElementTree.Element, inertia: pin.Inertia) -> None:
    """State a link's inertia, given in its own frame, in the stead of what it has."""
    inertial = link.find("inertial")
    if inertial is None:
        inertial = ElementTree.SubElement(link, "inertial")
    tail = inertial.text
    for child in list(inertial):
        inertial.remove(child)
    parts = {
        "origin": {"xyz": " ".join(f"{v:.9g}" for v in inertia.lever), "rpy": "0 0 0"},
        "mass": {"value": f"{inertia.mass:.9g}"},
        "inertia": {name: f"{inertia.inertia[at]:.9g}" for name, at in ENTRIES.items()},
    }
    for name, attributes in parts.items():
        ElementTree.SubElement(inertial, name, attributes).tail = tail


def stated_inertia(mass: float, centre: Sequence[float], moments: Sequence[float]) -> pin.Inertia:
    """Of a body, in its link's frame, as robot.toml states it in kg, m and kg·m²."""
    return pin.Inertia(mass, np.array(centre, dtype=float), symmetric(moments))


def state_inertias(links: Links, tables: Sequence[LinkTable]) -> None:
    """Put what [[link]] of robot.toml states before the links' own <inertial>."""
    for table in tables:
        if table.mass_kg is not None and table.link in links:
            centre, moments = table.centre_m or (0.0,) * 3, table.inertia_kg_m2 or (0.0,) * 6
            write_inertia(links[table.link], stated_inertia(table.mass_kg, centre, moments))
