"""Poses as a program of the robot's controller: KRL, RAPID, URScript, or a table."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from planner.errors import InputError
from planner.robot.collision import Collisions
from planner.robot.config import ControllerTable
from planner.robot.config_file import controller_axes
from planner.robot.robot import Robot
from planner.words import counted

ARM_AXES, EXTERNAL_AXES = 6, 6  # that KRL and RAPID have words for
UNUSED = "9E9"  # an external axis that is not there, in RAPID
CHECKED = "Only the poses themselves were checked for collision, not the ways between them."
UNCHECKED = "Nothing was checked for collision, neither the poses nor the ways between them:"
PARTLY = "Not all was checked for collision, and not the ways between poses:"
SLOWLY = "Run it slowly first, with a hand at the stop."
SIMULATED = "SIMULATED RECORDINGS: what chose these poses was not measured on a real robot."


@dataclass(frozen=True)
class PoseToDrive:
    """A pose in the URDF's joints (degrees, mm of slides), and what is to be hit there."""

    pose: str
    joints_deg: tuple[float, ...]
    hits: tuple[str, ...] = ("x", "y", "z")

    @property
    def note(self) -> str:
        """What to do there, in plain ASCII."""
        return f"{plain(self.pose)}: hit along {', '.join(plain(h) for h in self.hits)}"


@dataclass(frozen=True)
class DrivenPose:
    """A pose in the controller's `axes`, by their columns in tables: "A1_deg", …, "E1_mm", …"""

    name: str  # an identifier
    note: str
    axes: dict[str, float]


def heading(robot: Robot, simulated: bool) -> tuple[str, ...]:
    """What is to be known before the program is run, in lines of plain ASCII."""
    found = (CHECKED,)
    collisions = Collisions(robot)
    if collisions.nothing_checked:
        found = (UNCHECKED, f"{plain(robot.urdf_path.name)} has no collision geometry.")
    elif collisions.unchecked is not None:
        found = (PARTLY, plain(collisions.unchecked))
    return (*((SIMULATED,) if simulated else ()), *found, SLOWLY)


def plain(text: str) -> str:
    """Text that no controller takes for more than a comment."""
    return re.sub(r"[^A-Za-z0-9 _.,+-]", "_", text)


def identifier(text: str, start: str = "P_") -> str:
    """A name of at most 24 letters, digits and underscores that begins with a letter."""
    name = re.sub(r"\W", "_", text, flags=re.ASCII)[:24]
    return name if re.match(r"[A-Za-z]", name) else f"{start}{name}"[:24]


def program(
    kind: str, robot: Robot, name: str, poses: Sequence[PoseToDrive], simulated: bool = False
) -> str:
    """The program that drives to the poses one after the other and waits at each.

    `simulated`: the campaign that chose them rests on simulated recordings, which is said.
    Raises InputError where the robot's axes do not suit the controller.
    """
    table = robot.config.controller
    axes = controller_axes(table, robot.joints, robot.path)
    arm = [joint for joint in axes if joint not in table.external]
    external = len(axes) - len(arm)
    if kind == "urscript":
        _refuse_urscript(robot, arm, external)
    most = ARM_AXES if kind != "poses" else len(axes)
    if len(arm) > most or external > EXTERNAL_AXES:
        raise InputError(
            f"{robot.path}: {kind} has {ARM_AXES} axes of the arm, the robot {len(arm)}; name the "
            f"others in [controller] external, or export poses."
        )
    slides = [joint for joint in arm if robot.slides(joint)]
    if kind != "poses" and slides:
        raise InputError(
            f"{robot.path}: joint {slides[0]} slides, and axes of the arm turn in {kind}; name it "
            f"in [controller] external, or export poses."
        )
    used, driven = set[str](), []
    for pose in poses:
        values = dict(zip(robot.joint_names, pose.joints_deg, strict=True))
        turned = {a.name: a.sign * values[joint] + a.offset for joint, a in axes.items()}
        driven.append(DrivenPose(unique(identifier(pose.pose), used), pose.note, turned))
    said = heading(robot, simulated)
    return PROGRAMS[kind](identifier(name, "C_"), driven, table, said)


def _refuse_urscript(robot: Robot, arm: Sequence[str], external: int) -> None:
    """InputError where joints of the robot are others than the six of a UR arm."""
    sliding = [name for name in arm if robot.slides(name)]
    turning = len(arm) - len(sliding)
    if turning == ARM_AXES and not sliding and not external:
        return
    has = counted(turning, "such joint")
    has += f" and {len(sliding)} that slide ({', '.join(sliding)})" if sliding else ""
    has += f" and {counted(external, 'external axis', 'external axes')}" if external else ""
    raise InputError(
        f"{robot.path}: urscript can only move an arm of {ARM_AXES} joints that turn, and this "
        f"robot has {has}; export krl or rapid, whose external axes may slide, or poses, a table "
        f"in degrees and mm."
    )


def unique(name: str, used: set[str]) -> str:
    """The name, with a number where it was used already; it counts as used then."""
    found, number = name, 2
    while found.lower() in used:
        found, number = f"{name[:20]}_{number}", number + 1
    used.add(found.lower())
    return found


def _krl(
    name: str, poses: Sequence[DrivenPose], table: ControllerTable, said: Sequence[str]
) -> str:
    """KUKA Robot Language: point-to-point to each pose, halt there."""
    speed = f"{table.speed_percent:g}"
    lines = [f"DEF {name}( )", *(f"; {line}" for line in said), "BAS(#INITMOV, 0)",
             f"BAS(#VEL_PTP, {speed})", f"BAS(#ACC_PTP, {speed})"]  # fmt: skip
    for pose in poses:
        values = [f"{axis.partition('_')[0]} {v:.4f}" for axis, v in pose.axes.items()]
        lines += [f"; {pose.note}", f"PTP {{{', '.join(values)}}}", "HALT"]
    return "\r\n".join([*lines, "END", ""])


def _rapid(
    name: str, poses: Sequence[DrivenPose], table: ControllerTable, said: Sequence[str]
) -> str:
    """ABB RAPID: absolute joint moves, stop at each."""
    lines = [f"MODULE {name}", *(f"  ! {line}" for line in said)]
    for pose in poses:
        each = pose.axes.items()
        arm, outer = ([f"{v:.4f}" for axis, v in each if axis[0] == one] for one in "AE")
        arm += ["0"] * (ARM_AXES - len(arm))
        outer += [UNUSED] * (EXTERNAL_AXES - len(outer))
        target = f"[[{','.join(arm)}],[{','.join(outer)}]]"
        lines.append(f"  CONST jointtarget {pose.name}:={target};")
    lines += ["  PROC main()", f"    VelSet {table.speed_percent:g},1000;"]
    for pose in poses:
        lines += [f"    ! {pose.note}", f"    MoveAbsJ {pose.name}\\NoEOffs,v100,fine,tool0;",
                  "    Stop;"]  # fmt: skip
    return "\n".join([*lines, "  ENDPROC", "ENDMODULE", ""])


def _urscript(
    name: str, poses: Sequence[DrivenPose], table: ControllerTable, said: Sequence[str]
) -> str:
    """URScript: joint moves, a dialogue at each."""
    lines = [f"def {name}():", *(f"  # {line}" for line in said)]
    speed = f"{table.speed_percent / 100 * FASTEST_UR_RAD_S:.3f}"
    for pose in poses:
        values = ", ".join(f"d2r({v:.4f})" for v in pose.axes.values())
        lines += [f"  # {pose.note}", f"  movej([{values}], a=0.5, v={speed})",
                  f'  popup("{pose.note}", title="planner", blocking=True)']  # fmt: skip
    return "\n".join([*lines, "end", ""])


FASTEST_UR_RAD_S = 3.14  # joint speed of which `speed_percent` is a share, as UR's manuals state it


def _poses(_: str, poses: Sequence[DrivenPose], table: ControllerTable, said: Sequence[str]) -> str:
    """A table: axes as the controller counts them, in degrees, those that slide in mm.

    It has no room for sentences: each note begins with what is to be known first.
    """
    first = "".join(
        f"{line.partition(':')[0]}; " for line in said if line in (SIMULATED, UNCHECKED, PARTLY)
    )
    rows = [",".join(["pose", *(poses[0].axes if poses else ()), "note"])]
    for pose in poses:
        numbers = [f"{v:.4f}" for v in pose.axes.values()]
        rows.append(",".join([pose.name, *numbers, f'"{first}{pose.note}"']))
    return "\n".join([*rows, ""])


Writer = Callable[[str, Sequence[DrivenPose], ControllerTable, Sequence[str]], str]
PROGRAMS: dict[str, Writer] = {
    "krl": _krl, "rapid": _rapid, "urscript": _urscript, "poses": _poses,
}  # fmt: skip
SUFFIXES = {"krl": ".src", "rapid": ".mod", "urscript": ".script", "poses": ".csv"}
