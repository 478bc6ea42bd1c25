"""Inertias of a URDF's links: read, stated by robot.toml instead, written."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from planner.robot.config import LinkTable

ENTRIES = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}


def link_inertia(link: ElementTree.Element) -> pin.Inertia:
    """Of a link in its own frame; 0 where the URDF states none."""
    inertial = link.find("inertial")
    if inertial is None:
        return pin.Inertia.Zero()
    origin, mass, entries = (inertial.find(key) for key in ("origin", "mass", "inertia"))
    xyz, rpy = np.zeros(3), np.zeros(3)
    if origin is not None:
        xyz = np.array([float(v) for v in origin.get("xyz", "0 0 0").split()])
        rpy = np.array([float(v) for v in origin.get("rpy", "0 0 0").split()])
    moments = np.zeros((3, 3))
    if entries is not None:
        for name, (i, j) in ENTRIES.items():
            moments[i, j] = moments[j, i] = float(entries.get(name, "0"))
    turn = pin.rpy.rpyToMatrix(rpy)
    value = 0.0 if mass is None else float(mass.get("value", "0"))
    return pin.Inertia(value, xyz, turn @ moments @ turn.T)


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


def state_inertias(root: ElementTree.Element, tables: Sequence[LinkTable]) -> None:
    """Put what [[link]] of robot.toml states before the links' own <inertial>."""
    links = {link.get("name"): link for link in root.findall("link")}
    for table in tables:
        if table.mass_kg is not None and table.link in links:
            write_inertia(links[table.link], stated_inertia(table))


def stated_inertia(table: LinkTable) -> pin.Inertia:
    """What a [[link]] states, in the link's frame."""
    xx, xy, xz, yy, yz, zz = table.inertia_kg_m2 or (0.0,) * 6
    moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return pin.Inertia(table.mass_kg or 0.0, np.array(table.centre_m or (0.0,) * 3), moments)
