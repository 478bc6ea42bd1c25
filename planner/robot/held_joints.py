"""Joints that stay where they are: rails, turntables.

[held] of robot.toml says where. In the URDF they become fixed joints there, with all that they
carry, so that nothing else has to know of them.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pinocchio as pin

from planner.errors import InputError

TURNING, SLIDING = ("revolute", "continuous"), ("prismatic",)
Joints = Mapping[str, ElementTree.Element]  # by name
UNITS = {"_deg": TURNING, "_m": SLIDING, "_mm": SLIDING}
IN_SI = {"_deg": np.pi / 180, "_m": 1.0, "_mm": 1e-3}


def held_places(joints: Joints, held: Mapping[str, float], urdf: Path) -> dict[str, float]:
    """Where joints stay, in rad or m, by name: keys of `held` end in _deg (turning), _m or _mm.

    Joints that are fixed are left out: a text that was made from a robot is read again. Raises
    InputError where a key names no such joint, or a place beyond its limits.
    """
    found = {}
    for key, value in held.items():
        unit = next((u for u in UNITS if key.endswith(u)), "")
        joint = joints.get(key.removesuffix(unit))
        if not unit or joint is None:
            known = ", ".join(n for n, j in joints.items() if j.get("type") != "fixed")
            raise InputError(
                f"{urdf}: [held] {key} names no joint; give NAME_deg or NAME_m of {known}."
            )
        if joint.get("type") == "fixed":
            continue
        if joint.get("type") not in UNITS[unit]:
            other = "_m" if unit == "_deg" else "_deg"
            raise InputError(
                f"{urdf}: joint {joint.get('name')} is {joint.get('type')}; give [held] "
                f"{joint.get('name')}{other}."
            )
        place = value * IN_SI[unit]
        _check_limits(joint, place, 1 / IN_SI[unit], key, urdf)
        found[joint.get("name", "")] = place
    return found


def fix(joint: ElementTree.Element, value: float, urdf: Path) -> None:
    """Make a joint fixed at its coordinate `value`, in rad or m."""
    origin, axis = joint.find("origin"), joint.find("axis")
    if origin is None:
        origin = ElementTree.SubElement(joint, "origin")
    try:
        place = _vector(origin.get("xyz", "0 0 0"))
        turn = pin.rpy.rpyToMatrix(_vector(origin.get("rpy", "0 0 0")))
        along = _vector("1 0 0" if axis is None else axis.get("xyz", "1 0 0"))
    except ValueError:
        raise InputError(
            f"{urdf}: origin or axis of joint {joint.get('name')} is not three numbers; correct it."
        ) from None
    along = along / np.linalg.norm(along)
    if joint.get("type") in SLIDING:
        place = place + turn @ (value * along)
    else:
        turn = turn @ pin.AngleAxis(value, along).matrix()
    origin.set("xyz", " ".join(f"{v:.12g}" for v in place))
    origin.set("rpy", " ".join(f"{v:.12g}" for v in pin.rpy.matrixToRpy(turn)))
    joint.set("type", "fixed")
    for name in ("axis", "limit", "mimic", "dynamics", "calibration", "safety_controller"):
        for child in joint.findall(name):
            joint.remove(child)


def _check_limits(
    joint: ElementTree.Element, value: float, factor: float, key: str, urdf: Path
) -> None:
    """`factor` is how many of the key's units are a rad or a metre."""
    limit = joint.find("limit")
    if limit is None or joint.get("type") == "continuous":
        return
    try:
        low, high = float(limit.get("lower", "nan")), float(limit.get("upper", "nan"))
    except ValueError:
        return
    if value < low - 1e-9 or value > high + 1e-9:
        raise InputError(
            f"{urdf}: [held] {key} lies outside the joint's limits of {low * factor:.4g} to "
            f"{high * factor:.4g}; correct it."
        )


def _vector(text: str) -> np.ndarray:
    values = np.array([float(v) for v in text.split()])
    if values.shape != (3,):
        raise ValueError(text)
    return values
