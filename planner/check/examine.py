"""The whole check of a robot: also its collision geometry, a workspace, modes at home and there."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from planner.check.description import (
    SEVERITIES,
    CheckRemark,
    check_frames,
    check_joints,
    check_links,
)
from planner.check.springs import check_band, check_springs
from planner.dynamics.simulation import Simulation
from planner.errors import InputError, NoPoseLeftError
from planner.robot.collision import Collisions
from planner.robot.config import WorkspaceTable
from planner.robot.link_bodies import LinkBody, link_bodies
from planner.robot.robot import Robot
from planner.robot.workspace import Candidates, Workspace

POSES = 4  # poses looked at where no workspace is stated
TRIES = 60  # poses tried to find them
SPREAD = 8  # poses of the workspace that are looked at
RADIANS = 6.3  # ranges of joints in degrees that stay below are most likely radians
FIXED_BY_A_PLACE = 6  # coordinates of a place and a direction
METRES = 20.0  # ranges of slides in mm that stay below are most likely metres
NOTHING_DEG = 8.0  # by which all joints together move in a workspace that nobody means
NARROW_DEG = 15.0  # unless other joints move by this much


@dataclass(frozen=True)
class Plan:
    """What a campaign asks of a robot; `file` is its campaign.toml."""

    file: str
    workspace: WorkspaceTable
    band_hz: tuple[float, float]
    count: int
    simulated: bool  # whether it uses the simulation


@dataclass(frozen=True, eq=False)
class Examination:
    """What was found. `q` (n, dof) in rad are the poses looked at, home first.

    Frequencies (n, e) in Hz and damping ratios of their modes, NaN where there is none.
    """

    robot: Robot
    links: tuple[LinkBody, ...]
    remarks: tuple[CheckRemark, ...]
    poses: tuple[str, ...]
    q: np.ndarray
    frequency_hz: np.ndarray
    damping_ratio: np.ndarray

    @property
    def errors(self) -> tuple[CheckRemark, ...]:
        """What a campaign cannot begin with."""
        return tuple(r for r in self.remarks if r.severity == "error")


def home_of(robot: Robot) -> np.ndarray:
    """Joint angles (dof,) in rad: 0 where the limits allow it, else the middle between them."""
    return np.where((robot.lower_rad <= 0) & (robot.upper_rad >= 0), 0.0, robot.middle_rad)


def examine(robot: Robot, plan: Plan | None = None) -> Examination:
    """Check a robot that was loaded, and what a campaign asks of it."""
    links, home = link_bodies(robot), home_of(robot)
    found = [*check_links(robot, links), *check_joints(robot, plan is not None)]
    found += [*check_frames(robot), *check_collision(robot, links, home)]
    if plan is None:
        collisions = Collisions(robot)
        free = (q for q in spread_poses(robot)[1:] if not collisions.contacts(q))
        others = np.array([*islice(free, POSES)]).reshape(-1, len(home))
    else:
        candidates, remarks = check_workspace(robot, plan.workspace, plan.file)
        found += remarks
        others = np.empty((0, len(home))) if candidates is None else candidates.q
    poses = ("home", *(f"pose {k + 1}" for k in range(len(others))))
    q = np.concatenate([home[None], others])
    frequency, damping = np.empty((len(q), 0)), np.empty((len(q), 0))
    if plan is None or plan.simulated:
        found, frequency, damping = _simulated(robot, q, plan, found)
    worst_first = tuple(sorted(found, key=lambda remark: SEVERITIES.index(remark.severity)))
    return Examination(robot, links, worst_first, poses, q, frequency, damping)


def _simulated(
    robot: Robot, q: np.ndarray, plan: Plan | None, found: list[CheckRemark]
) -> tuple[list[CheckRemark], np.ndarray, np.ndarray]:
    """With what springs and modes say; frequencies and damping ratios (n, e)."""
    none = np.empty((len(q), 0))
    try:
        simulation = Simulation(robot)
    except InputError as error:
        severity = "error" if plan is not None or robot.config.compliance else "warning"
        text = str(error).removeprefix(str(robot.path)).lstrip(": ")
        return [*found, CheckRemark(severity, text, robot.path.name)], none, none
    found = found + check_springs(simulation, q)
    if any(r.severity == "error" for r in found):
        return found, none, none
    modes = simulation.frequencies(q, simulation.elastic.size)
    there = modes.frequency_hz if plan is None else modes.frequency_hz[1:]
    there = there if len(there) else modes.frequency_hz
    found += check_band(robot.path.name, there, robot.config.band_hz, None)
    if plan is not None:
        found += check_band(f"{plan.file}, [modes]", there, plan.band_hz, plan.count)
    return found, modes.frequency_hz, modes.damping_ratio


def spread_poses(robot: Robot) -> np.ndarray:
    """Home, then poses (n, dof) in rad between the limits, or within half a turn of home."""
    rng, home = np.random.default_rng(0), home_of(robot)
    low = np.maximum(robot.lower_rad, home - np.pi)
    high = np.minimum(robot.upper_rad, home + np.pi)
    return np.array([home, *(rng.uniform(low, high) for _ in range(TRIES))])


def check_collision(
    robot: Robot, links: tuple[LinkBody, ...], home: np.ndarray
) -> Iterator[CheckRemark]:
    """What collision geometry lacks, and what touches at home (dof,) in rad."""
    collisions, where = Collisions(robot), f"{robot.urdf_path.name}, <collision>"
    if collisions.unchecked is not None:
        remedy = (
            "Add <collision> boxes or cylinders to the URDF's links, or the mesh files it names."
        )
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
