"""Checks of collision geometry, and of the workspace against the robot."""

from collections.abc import Iterator

import numpy as np

from planner.check.description import CheckRemark
from planner.errors import InputError, NoPoseLeftError
from planner.robot.collision import Collisions
from planner.robot.config import WorkspaceTable
from planner.robot.link_bodies import LinkBody
from planner.robot.robot import Robot
from planner.robot.workspace import Candidates, Workspace

SPREAD = 8  # poses of the workspace that are looked at
RADIANS = 6.3  # ranges of joints in degrees that stay below are most likely radians
FIXED_BY_A_PLACE = 6  # coordinates of a place and a direction
METRES = 20.0  # ranges of slides in mm that stay below are most likely metres
NOTHING_DEG = 8.0  # by which all joints together move in a workspace that nobody means
NARROW_DEG = 15.0  # unless other joints move by this much


def check_collision(
    robot: Robot, links: tuple[LinkBody, ...], home: np.ndarray
) -> Iterator[CheckRemark]:
    """What collision geometry lacks, and what touches at home (dof,) in rad."""
    collisions, where = Collisions(robot), f"{robot.urdf_path.name}, <collision>"
    if collisions.unchecked is not None:
        remedy = "Add <collision> boxes or cylinders to its links, or the meshes."
        yield CheckRemark("warning", collisions.unchecked, where, remedy)
    if collisions.none_checked:
        return
    told = {one.link for one in collisions.left_out}
    shaped = {link.joint for link in links if link.shapes or link.name in told}
    bare = [name for name in robot.joint_names if name not in shaped]
    if bare:
        moves = "moves" if any(map(robot.slides, bare)) else "turns"
        text = f"What {', '.join(bare)} {moves} has no collision shape and is not checked."
        remedy = "Add <collision> boxes or cylinders to these links."
        yield CheckRemark("warning", text, where, remedy)
    if not robot.config.obstacle:
        text = "There is no [[obstacle]]: floor, table and fence are not checked."
        yield CheckRemark("note", text, robot.path.name, "Add boxes: name, center_m, size_m.")
    touching, overlapping = collisions.contacts(home), collisions.overlapping
    if touching:
        remedy = "Shrink the shapes, or list the pair in [collision] ignore."
        yield CheckRemark("note", f"At home {'; '.join(touching)}.", where, remedy)
    if overlapping:
        text = f"In the middle of all joints' ranges {'; '.join(overlapping)}: not checked."
        yield CheckRemark("note", text, where, "Shrink the shapes if they are to be checked.")


def check_workspace(
    robot: Robot, table: WorkspaceTable, file: str
) -> tuple[Candidates | None, list[CheckRemark]]:
    """A few poses of the workspace, and what looks wrong in it."""
    where = f"{file}, [workspace]"
    found = [*_units(robot, table, where), *_redundant(robot, table, where)]
    try:
        candidates = Workspace.from_table(table, robot).candidates(robot, SPREAD, 0)
    except NoPoseLeftError as error:
        return None, [*found, CheckRemark("error", str(error), where)]
    except InputError as error:
        return None, [*found, CheckRemark("error", str(error), file)]
    kept, lost = len(candidates.q), sum(candidates.rejected.values())
    if lost > kept:
        most = max(candidates.rejected, key=lambda reason: candidates.rejected[reason])
        text = f"Of {kept + lost} poses looked at the robot can reach {kept} (most often: {most})."
        found.append(CheckRemark("warning", text, where, "Narrow the workspace."))
    return candidates, found


def _redundant(robot: Robot, table: WorkspaceTable, where: str) -> Iterator[CheckRemark]:
    """Places of the tool do not say how a robot stands that has more joints than they fix."""
    count = len(robot.tool_joints)
    if table.position_m is not None and count > FIXED_BY_A_PLACE:
        text = (
            f"{count} joints move the tool, and a place of it fixes {FIXED_BY_A_PLACE}: the robot "
            f"can stand there in many ways, which vibrate differently, but the model knows places "
            f"only."
        )
        remedy = "Give joints_deg, or say in robot.toml's [held] where rails and turntables stay."
        yield CheckRemark("warning", text, f"{where} position_m", remedy)


def _units(robot: Robot, table: WorkspaceTable, where: str) -> Iterator[CheckRemark]:
    """Ranges that look as if they were in other units, the first only."""
    joints_deg, position_m = table.joints_deg, table.position_m
    if joints_deg is not None:
        box, slides = np.array(joints_deg, dtype=float), np.array(robot.joints.slides)
        if slides.any() and len(box) == len(slides):
            shifts, box = np.abs(box[slides]).max(), box[~slides]
            if 0 < shifts < METRES:
                text = f"No joint slides beyond {shifts:.3g} mm, as if in metres."
                yield CheckRemark("warning", text, f"{where} joints_deg", "Give millimetres.")
                return
        wide = np.ptp(box, axis=1).max() if box.size else 0.0
        if 0 < np.abs(box).max(initial=0.0) < RADIANS and wide < NARROW_DEG:
            text = f"No joint moves by more than {wide:.3g}°, as if the ranges were in radians."
            severity = "error" if np.ptp(box, axis=1).sum() < NOTHING_DEG else "warning"
            yield CheckRemark(severity, text, f"{where} joints_deg", "Give degrees.")
    elif position_m is not None and np.abs(np.array(position_m, dtype=float)).max() > 50:
        text = "Positions of more than 50 m, as if they were in millimetres."
        yield CheckRemark("warning", text, f"{where} position_m", "Give metres.")
