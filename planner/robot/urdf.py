"""URDF files: read, checked, and parsed by Pinocchio without chatter on the terminal.

Of a xacro file, from which URDFs are made, what it expands to is read.
"""

import os
import re
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pinocchio as pin

from planner.errors import InputError
from planner.robot.mesh_files import urdf_source
from planner.robot.urdf_joints import settle_joints

LARGEST, FARTHEST_M = 1e7, 1e3  # kg, kg·m, kg·m² of what turns; between joints: no robot has it


def read_urdf(urdf: Path, robot_toml: Path, held: Mapping[str, float]) -> ElementTree.Element:
    """The checked XML; continuous joints are given limits of ±180°. Raises InputError.

    `held` is robot.toml's: joints that stay where they are become fixed ones.
    """
    try:
        text = urdf_source(urdf)
    except OSError as error:
        missing = isinstance(error, FileNotFoundError)
        fault = "does not exist" if missing else f"cannot be read ({error.strerror})"
        raise InputError(
            f"{robot_toml}: its URDF {urdf} {fault}; correct the entry urdf."
        ) from None
    root = _root(text, urdf)
    if not settle_joints(root, urdf, held):
        raise InputError(f"{urdf} has no joint that moves; name the URDF of a robot arm.")
    return root


def read_tree(urdf: Path) -> ElementTree.Element:
    """A URDF's XML as it is, whose joints form a tree. Raises InputError."""
    try:
        return _root(urdf_source(urdf), urdf)
    except OSError as error:
        raise InputError(f"{urdf} cannot be read ({error.strerror}); name a URDF.") from None


def _root(text: bytes | str, urdf: Path) -> ElementTree.Element:
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{urdf} is not a readable URDF ({error}); correct it.") from None
    if root.tag != "robot":
        raise InputError(f"{urdf} has <{root.tag}> at its top, not <robot>; name a URDF.")
    _check_tree(root, urdf)
    return root


def build_model(text: str, urdf: Path) -> pin.Model:
    """Pinocchio's model; InputError with the parser's own words where it refuses or skips."""
    with quiet() as said:
        try:
            model = pin.buildModelFromXML(text)
        except Exception as error:
            fault = _complaint(said()) or " ".join(str(error).split())
            raise InputError(f"{urdf} is not a usable URDF ({fault}); correct it.") from None
        # The parser goes on without an <inertial> or <collision> that it does not understand.
        if "Could not parse" in said():
            raise InputError(f"{urdf} is not a usable URDF ({_complaint(said())}); correct it.")
    _check_inertias(model, urdf)
    return model


@contextmanager
def quiet() -> Iterator:
    """Keep the parser's chatter off the terminal (it writes past Python); yields what it said."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(1), os.dup(2)]
    with tempfile.TemporaryFile() as file:

        def said() -> str:
            file.seek(0)
            return file.read().decode(errors="replace")

        try:
            os.dup2(file.fileno(), 1)
            os.dup2(file.fileno(), 2)
            yield said
        finally:
            for number, handle in enumerate(kept, 1):
                os.dup2(handle, number)
                os.close(handle)


def _complaint(chatter: str) -> str:
    """What the parser found, and (its second line) in which joint or link."""
    lines = re.findall(r"Error:\s*(.+)", chatter)[:2]
    return ", ".join(dict.fromkeys(line.split(".  ")[0].strip().rstrip(".") for line in lines))


def _check_tree(root: ElementTree.Element, urdf: Path) -> None:
    """Joints must not form a loop: the parser then silently drops what hangs in it."""
    parent_of: dict[str, str] = {}
    for joint in root.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is None or child is None:
            raise InputError(
                f"{urdf}: joint {joint.get('name', '?')} needs a <parent> and a <child>; add them."
            )
        parent_of[child.get("link", "")] = parent.get("link", "")
    for link in parent_of:
        at, steps = link, 0
        while at in parent_of:
            at, steps = parent_of[at], steps + 1
            if steps > len(parent_of):
                raise InputError(
                    f"{urdf}: the joints around link {link} form a loop; an arm must be a tree "
                    f"that starts at its base."
                )


def _said(values: np.ndarray) -> str:
    return "(" + ", ".join(f"{v:.3g}" for v in values) + ")"


def _check_inertias(model: pin.Model, urdf: Path) -> None:
    for name, inertia, place in zip(
        list(model.names)[1:], list(model.inertias)[1:], list(model.jointPlacements)[1:],
        strict=True,
    ):  # fmt: skip
        values = np.array(inertia.toDynamicParameters())
        if not np.all(np.abs([*values, *inertia.lever]) < LARGEST):
            raise InputError(
                f"{urdf}: the links that turn with {name} have mass {inertia.mass:.4g} kg and "
                f"centre of mass {_said(inertia.lever)} m; give kg, m and kg·m²."
            )
        if not np.all(np.abs(place.translation) < FARTHEST_M):
            raise InputError(
                f"{urdf}: joint {name} is {_said(place.translation)} m from the one before; give m."
            )
        moments = np.linalg.eigvalsh(inertia.inertia)
        if inertia.mass < 0 or moments[0] < -1e-9 * abs(moments[-1]):
            raise InputError(
                f"{urdf}: the links that turn with {name} have mass {inertia.mass:.4g} kg and "
                f"principal moments {np.round(moments, 6).tolist()} kg·m²; none may be negative."
            )
