"""The axes of the robot's controller: which joint each one is, its sign and offset."""

from dataclasses import replace
from pathlib import Path

from planner.errors import InputError
from planner.recording.joints import AxisColumn, JointUnits
from planner.robot.config import ControllerTable


def axes_of(
    table: ControllerTable, joints: JointUnits, path: Path
) -> list[tuple[str, float, float]]:
    """The controller's axes in order: joint of the URDF, sign, offset in degrees (slides: mm).

    Raises InputError, naming robot.toml's `path`, where they do not suit the robot.
    """
    names = joints.names
    order = table.joints or names
    if sorted(order) != sorted(names):
        raise InputError(
            f"{path}: [controller] joints names {', '.join(order)}; it needs each of "
            f"{', '.join(names)} once."
        )
    for entry, values in (("signs", table.signs), ("offsets_deg", table.offsets_deg)):
        if values and len(values) != len(order):
            raise InputError(
                f"{path}: [controller] {entry} has {len(values)} numbers, the robot "
                f"{len(order)} joints; give one a joint."
            )
    missing = [name for name in table.external if name not in names]
    if missing:
        raise InputError(
            f'{path}: [controller] external names "{missing[0]}", which is no joint of the '
            f"robot; it has {', '.join(names)}."
        )
    signs = table.signs or (1.0,) * len(order)
    offsets = table.offsets_deg or (0.0,) * len(order)
    return list(zip(order, signs, offsets, strict=True))


def column_names(arm: int, external: int) -> list[str]:
    """What tables call so many axes of the arm and external ones, without their units."""
    return [f"{k}{i}" for k, n in (("A", arm), ("E", external)) for i in range(1, n + 1)]


def with_axes(table: ControllerTable, joints: JointUnits, path: Path) -> JointUnits:
    """Joints whose tables may be in the controller's axes too, as `export poses` writes them."""
    axes = sorted(axes_of(table, joints, path), key=lambda axis: axis[0] in table.external)
    external = len(table.external)
    named = zip(axes, column_names(len(axes) - external, external), strict=True)
    unit = dict(zip(joints.names, joints.units, strict=True))
    found = {j: AxisColumn(f"{name}_{unit[j]}", s, o) for (j, s, o), name in named}
    return replace(joints, axes=tuple(found[name] for name in joints.names))
