"""Checks of collision geometry, and of the workspace against the robot."""

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
) -> list[CheckRemark]:
    """What collision geometry lacks, and what touches at home (dof,) in rad."""
    collisions, urdf = Collisions(robot), robot.urdf_path.name
    found = []
    if collisions.unchecked is not None:
        remedy = "Add <collision> boxes or cylinders to its links, or the meshes."
        found.append(CheckRemark("warning", collisions.unchecked, f"{urdf}, <collision>", remedy))
    if collisions.none_checked:
        return found
    told = {one.link for one in collisions.left_out}
    shaped = {link.joint for link in links if link.shapes or link.name in told}
    bare = [name for name in robot.joint_names if name not in shaped]
    if bare:
        moves = "moves" if any(map(robot.slides, bare)) else "turns"
        text = f"What {', '.join(bare)} {moves} has no collision shape and is not checked."
        remedy = "Add <collision> boxes or cylinders to these links."
        found.append(CheckRemark("warning", text, f"{urdf}, <collision>", remedy))
    if not robot.config.obstacle:
        text = "There is no [[obstacle]]: floor, table and fence are not checked."
        remedy = "Add boxes: name, center_m, size_m."
        found.append(CheckRemark("note", text, robot.path.name, remedy))
    touching = collisions.contacts(home)
    if touching:
        text = f"At home {'; '.join(touching)}."
        remedy = "Shrink the shapes, or list the pair in [collision] ignore."
        found.append(CheckRemark("note", text, f"{urdf}, <collision>", remedy))
    overlapping = collisions.overlapping
    if overlapping:
        text = f"In the middle of all joints' ranges {'; '.join(overlapping)}: not checked."
        remedy = "Shrink the shapes if they are to be checked."
        found.append(CheckRemark("note", text, f"{urdf}, <collision>", remedy))
    return found


def look_around(
    robot: Robot, table: WorkspaceTable, file: str
) -> tuple[Candidates | None, list[CheckRemark]]:
    """A few poses of the workspace, and what looks wrong in it."""
    where, found = (
        f"{file}, [workspace]",
        _units(robot, table, file) + _redundant(robot, table, file),
    )
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


def _redundant(robot: Robot, table: WorkspaceTable, file: str) -> list[CheckRemark]:
    """Places of the tool do not say how a robot stands that has more joints than they fix."""
    count = len(robot.tool_joints)
    if table.position_m is None or count <= FIXED_BY_A_PLACE:
        return []
    text = (
        f"{count} joints move the tool, and a place of it fixes {FIXED_BY_A_PLACE}: the robot can "
        f"stand there in many ways, which vibrate differently, but the model knows places only."
    )
    remedy = "Give joints_deg, or say in robot.toml's [held] where rails and turntables stay."
    return [CheckRemark("warning", text, f"{file}, [workspace] position_m", remedy)]


def _units(robot: Robot, table: WorkspaceTable, file: str) -> list[CheckRemark]:
    joints_deg, position_m = table.joints_deg, table.position_m
    if joints_deg is not None:
        box, slides = np.array(joints_deg, dtype=float), np.array(robot.joints.slides)
        if slides.any() and len(box) == len(slides):
            shifts, box = box[slides], box[~slides]
            if 0 < np.abs(shifts).max() < METRES:
                text = f"No joint slides beyond {np.abs(shifts).max():.3g} mm, as if in metres."
                where = f"{file}, [workspace] joints_deg"
                return [CheckRemark("warning", text, where, "Give millimetres.")]
        wide = np.ptp(box, axis=1).max() if box.size else 0.0
        if 0 < np.abs(box).max(initial=0.0) < RADIANS and wide < NARROW_DEG:
            text = f"No joint moves by more than {wide:.3g}°, as if the ranges were in radians."
            where = f"{file}, [workspace] joints_deg"
            severity = "error" if np.ptp(box, axis=1).sum() < NOTHING_DEG else "warning"
            return [CheckRemark(severity, text, where, "Give degrees.")]
    elif position_m is not None and np.abs(np.array(position_m, dtype=float)).max() > 50:
        text = "Positions of more than 50 m, as if they were in millimetres."
        where = f"{file}, [workspace] position_m"
        return [CheckRemark("warning", text, where, "Give metres.")]
    return []
