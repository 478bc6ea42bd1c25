"""Points of robot.toml: frames of the robot's model that may be hit and carry sensors."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from planner.errors import InputError
from planner.recording.points import AXES, SENSOR, TCP, PointNames
from planner.robot.config import PointTable
from planner.robot.urdf_elements import placed

PREFIX = "point "  # of the frames' names, so that a point may be called like a link
SAME_M, SAME_RAD = 1e-6, 1e-6  # two frames are one: as exactly as files state places


def check_points(points: Sequence[PointTable], path: Path) -> None:
    """Raise InputError where an entry makes no sense by itself."""
    names = [point.name for point in points]
    nodes = [point.node for point in points]
    for number, point in enumerate(points, 1):
        entry = f"{path}: [[point]] number {number} ({point.name})"
        if not point.name or point.name.isdigit() or any(c.isspace() for c in point.name):
            raise InputError(
                f'{path}: [[point]] number {number} is named "{point.name}"; give it a name '
                f"without blanks that is no number."
            )
        if names.index(point.name) != number - 1:
            raise InputError(f"{entry} is named like an earlier one; give each a name of its own.")
        if point.node is not None and nodes.index(point.node) != number - 1:
            other = names[nodes.index(point.node)]
            raise InputError(f"{entry} has node {point.node}, which is {other}'s; correct one.")
        if point.node is not None and point.node < 1:
            raise InputError(f"{entry} has node {point.node}; give a number above 0.")
        if not set(point.axes) <= set(AXES) or len(set(point.axes)) < max(len(point.axes), 1):
            raise InputError(f'{entry} has axes {list(point.axes)}; give some of "x", "y", "z".')
        if not 0 <= point.mass_kg < 1e3:
            raise InputError(f"{entry} has mass_kg {point.mass_kg}; give 0 kg or more.")
        if not all(abs(v) < 1e4 for v in (*point.position_m, *point.rpy_deg)):
            raise InputError(f"{entry} has a position_m or rpy_deg that is no finite number.")


def add_points(model: pin.Model, points: Sequence[PointTable], ids: Iterable[int]) -> None:
    """New frames of the model, at the points; `ids` are the numbers of their links' frames."""
    for point, number in zip(points, ids, strict=True):
        frame = model.frames[number]
        place = frame.placement * placed(point.position_m, point.rpy_deg)
        added = pin.Frame(
            PREFIX + point.name, frame.parentJoint, number, place, pin.FrameType.OP_FRAME
        )
        model.addFrame(added)


def names_of(
    model: pin.Model, points: Sequence[PointTable], tcp: int, sensor: int, path: Path
) -> PointNames:
    """What recordings may call the points of a model that has frames for them.

    Raises InputError where a point is called like the tool's and lies elsewhere.
    """
    place = {p.name: model.getFrameId(PREFIX + p.name, pin.FrameType.OP_FRAME) for p in points}
    for name, there in ((TCP, tcp), (SENSOR, sensor)):
        if name in place and not is_one_place(model, place[name], there):
            raise InputError(
                f'{path}: [[point]] "{name}" is not where robot.toml\'s {name}_frame is: state '
                f'{name}_frame = "{name}" to put that there, or leave out its link and place.'
            )
        place.setdefault(name, there)
    return PointNames(
        {p.name: "".join(axis for axis in AXES if axis in p.axes) for p in points},
        {str(p.node): p.name for p in points if p.node is not None},
        tuple(name for name, own in place.items() if is_one_place(model, own, tcp)),
        tuple(name for name, own in place.items() if is_one_place(model, own, sensor)),
    )


def is_one_place(model: pin.Model, one: int, other: int) -> bool:
    """Whether two frames of a model, by their numbers, are one."""
    a, b = model.frames[one], model.frames[other]
    if a.parentJoint != b.parentJoint:
        return False
    off = a.placement.actInv(b.placement)
    turned = float(np.linalg.norm(pin.log3(off.rotation)))
    return float(np.linalg.norm(off.translation)) < SAME_M and turned < SAME_RAD
