"""robot.toml read and checked: what is wrong is said in one sentence."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from planner.errors import InputError
from planner.recording.joints import AxisColumn, JointUnits
from planner.recording.points import AXES
from planner.robot.config import (
    BASE,
    LISTS,
    Compliance,
    ControllerTable,
    OuterHalf,
    RobotConfig,
    symmetric,
)
from planner.robot.joint_laws import NUMBER_ENTRIES, LawTable
from planner.toml_file import load_toml
from planner.words import command

if TYPE_CHECKING:
    from planner.robot.robot import Robot


def load_config(path: Path) -> RobotConfig:
    """Read and check robot.toml; InputError with one sentence where it is wrong."""
    if path.suffix == ".urdf":
        begin = command("planner", "new", "DIR", "--urdf", path)
        raise InputError(f"{path} is a URDF; robot.toml is made of it by {begin} --mass-kg M.")
    config = load_toml(path, RobotConfig, "robot.toml")
    _check(config, path)
    # What effects add stands in the other lists, after their own.
    added = {
        name: (*getattr(config, name), *(x for e in config.effects for x in getattr(e, name)))
        for name in LISTS
    }
    whole = msgspec.structs.replace(config, **added)
    _check_compliances(whole, path)
    for block in whole.resonator:
        length = float(np.linalg.norm(block.direction))
        if not 0 < length < np.inf:
            raise InputError(
                f"{path}: the direction of the resonator at {block.joint} has length {length:.4g}; "
                f"give the way in which it swings, in the joint's frame."
            )
    return whole


def _check(config: RobotConfig, path: Path) -> None:
    _check_compliances(config, path)
    _check_payloads(config, path)
    _check_links(config, path)
    _check_obstacles(config, path)
    _check_points(config, path)
    low, high = config.band_hz
    if not 0 < low < high < float("inf"):
        raise InputError(f"{path}: band_hz {[low, high]} must rise from above 0 Hz; correct it.")


def _check_compliances(config: RobotConfig, path: Path) -> None:
    first: dict[str, Compliance] = {}
    for number, block in enumerate(config.compliance, 1):
        entry = f"{path}: [[compliance]] number {number} ({block.joint})"
        length = sum(a * a for a in block.axis) ** 0.5
        if not abs(length - 1) < 1e-3:
            raise InputError(f"{entry} has an axis of length {length:.4g}; give a unit vector.")
        same = first.setdefault(block.tie or f"\0{number}", block)
        for key in ("stiffness", "damping", "loss_factor", "stiffness_sd_percent"):
            if getattr(same, key) != getattr(block, key):
                raise InputError(
                    f'{entry} is tied to "{block.tie}" but has another {key} '
                    f"({getattr(block, key)}, not {getattr(same, key)}); give tied blocks the same."
                )


def check_own_springs(robot: "Robot") -> None:
    """A joint that slides gives along its axis, in N/m; InputError where it is told to turn only.

    Beside its own spring its carriage may roll about that axis.
    """
    for name, axis in zip(robot.joint_names, robot.joint_axes, strict=True):
        blocks = [b for b in robot.config.compliance if b.joint == name and robot.slides(name)]
        own = [b.slide for b in blocks if abs(np.array(b.axis) @ axis) > 0.9]
        if own and not any(own):
            raise InputError(
                f"{robot.path}: joint {name} slides, but its [[compliance]] turns about its axis, "
                f"in N·m/rad; state its own spring along that axis with stiffness_n_m (N/m) and "
                f"damping_n_s_m (N·s/m)."
            )


def check_laws(robot: "Robot") -> None:
    """Raise InputError where a [[law]] is not that of a joint with a spring of its own."""
    for number, law in enumerate(robot.config.law, 1):
        entry = f"{robot.path}: [[law]] number {number} ({law.joint})"
        if law.joint not in robot.joint_names:
            names = ", ".join(robot.joint_names)
            raise InputError(f"{entry} is of no actuated joint; name one of {names}.")
        wanted = LawTable.entries(law.kind, robot.slides(law.joint))
        stated = [name for name in NUMBER_ENTRIES if getattr(law, name) is not None]
        if set(stated) != set(wanted):
            said = ", ".join(stated) or "neither"
            raise InputError(
                f'{entry} states {said}; of kind "{law.kind}" give {" and ".join(wanted)}.'
            )
        own = [b for b in robot.config.compliance if b.joint == law.joint and robot.is_own(b)]
        if not own:
            raise InputError(f"{entry} has no [[compliance]] about the joint's own axis; add that.")
        if not own[0].stiffness + law.weakest > 0:
            raise InputError(
                f"{entry} takes away more than the whole stiffness of its [[compliance]], "
                f"{own[0].stiffness:.4g}; state less, or a stiffer spring."
            )


def _check_payloads(config: RobotConfig, path: Path) -> None:
    for number, block in enumerate(config.payload, 1):
        entry = f"{path}: [[payload]] number {number} ({block.link})"
        if not 0 < block.mass <= 1e5:  # in [[effects]] it may be below
            raise InputError(f"{entry} has mass {block.mass}; give one above 0 kg, at most 1e5 kg.")
        moments = symmetric(block.inertia_kg_m2)
        finite = bool(np.all(np.isfinite(moments)))
        if not finite or np.linalg.eigvalsh(moments)[0] < -1e-9 * np.abs(moments).max():
            raise _no_body(entry, block.inertia_kg_m2)


def _check_links(config: RobotConfig, path: Path) -> None:
    named = [table.link for table in config.link]
    for number, table in enumerate(config.link, 1):
        entry = f"{path}: [[link]] number {number} ({table.link})"
        if named.index(table.link) != number - 1:
            raise InputError(f"{entry} states a link that an earlier one states; keep one of them.")
        if table.outer_half is not None:
            _check_body(f"{entry} outer_half", table.outer_half)
        stated = (table.mass_kg, table.centre_m, table.inertia_kg_m2)
        if all(value is None for value in stated):
            if table.sd_percent is None and table.outer_half is None:
                raise InputError(f"{entry} states nothing; give mass_kg, centre_m, inertia_kg_m2.")
            continue
        if table.mass_kg is None or table.centre_m is None or table.inertia_kg_m2 is None:
            raise InputError(f"{entry} needs mass_kg, centre_m and inertia_kg_m2; give all three.")
        _check_body(entry, OuterHalf(table.mass_kg, table.centre_m, table.inertia_kg_m2))


def _check_body(entry: str, body: OuterHalf) -> None:
    moments = np.linalg.eigvalsh(symmetric(body.inertia_kg_m2))
    if moments[0] < 0 or moments[0] + moments[1] < moments[2] * (1 - 1e-6):
        raise _no_body(entry, body.inertia_kg_m2)


def _no_body(entry: str, moments: Sequence[float]) -> InputError:
    return InputError(
        f"{entry} has inertia_kg_m2 {list(moments)}, which no body can have; give xx, xy, xz, yy, "
        f"yz, zz in kg·m² about its centre of mass."
    )


def _check_obstacles(config: RobotConfig, path: Path) -> None:
    names = [block.name for block in config.obstacle]
    for number, block in enumerate(config.obstacle, 1):
        if names.index(block.name) != number - 1:
            raise InputError(
                f'{path}: [[obstacle]] number {number} is named "{block.name}" like an earlier '
                f"one; give every obstacle a name of its own."
            )


def _check_points(config: RobotConfig, path: Path) -> None:
    names = [point.name for point in config.point]
    nodes = [point.node for point in config.point]
    for number, point in enumerate(config.point, 1):
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
        if not set(point.axes) <= set(AXES) or len(set(point.axes)) < max(len(point.axes), 1):
            raise InputError(f'{entry} has axes {list(point.axes)}; give some of "x", "y", "z".')


def check_entries(robot: "Robot") -> None:
    """Raise InputError where robot.toml names what there is not, or a joint has no range."""
    for entry, name, number in (
        ("tcp_frame", robot.config.tcp_frame, robot.tcp_id),
        ("sensor_frame", robot.config.sensor_frame, robot.sensor_id),
    ):
        if robot.model.frames[number].parentJoint == 0:
            raise InputError(
                f'{robot.path}: {entry} "{name}" is fixed to the base and never moves; name a '
                f"frame on the tool."
            )
    for block in robot.config.compliance:
        if block.joint not in (*robot.joint_names, BASE) and not robot.carries(block.joint):
            fault = f"is no actuated joint of {robot.urdf_path.name}, nor a link with one beyond"
            if block.joint in robot.linkage.names:
                fault = "follows another (<mimic>), with which it gives"
            raise InputError(
                f'{robot.path}: [[compliance]] joint "{block.joint}" {fault}; name one of '
                f"{', '.join(robot.joint_names)}."
            )
    for block in (*robot.config.resonator, *robot.config.harmonic):
        if block.joint not in robot.joint_names:
            raise InputError(
                f'{robot.path}: [[effects]] joint "{block.joint}" is no actuated joint of '
                f"{robot.urdf_path.name}; it has {', '.join(robot.joint_names)}."
            )
    for block in robot.config.payload:
        robot.frame_id("[[payload]] link", block.link)
    for table in robot.config.link:
        robot.frame_id("[[link]] link", table.link)
    bad = np.flatnonzero(~(robot.lower_rad < robot.upper_rad))
    if bad.size:
        raise InputError(
            f"{robot.urdf_path}: {robot.joint_names[bad[0]]} has no range between its limits; "
            f"give lower and upper in {'m' if robot.joints.slides[bad[0]] else 'rad'}."
        )


def controller_axes(
    table: ControllerTable, joints: JointUnits, path: Path
) -> dict[str, AxisColumn]:
    """By joint of the URDF its column in tables that count as the controller does.

    In its order: the arm's axes (A1, A2, …), then external ones (E1, …). Raises InputError, naming
    robot.toml's `path`, where they do not suit the robot.
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
    signs = dict(zip(order, table.signs or (1.0,) * len(order), strict=True))
    offsets = dict(zip(order, table.offsets_deg or (0.0,) * len(order), strict=True))
    units, found = dict(zip(names, joints.units, strict=True)), {}
    for letter, outside in (("A", False), ("E", True)):
        group = (name for name in order if (name in table.external) == outside)
        for number, name in enumerate(group, 1):
            column = f"{letter}{number}_{units[name]}"
            found[name] = AxisColumn(column, signs[name], offsets[name])
    return found
