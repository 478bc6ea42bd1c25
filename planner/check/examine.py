"""The whole check of a robot's description: findings, masses, modes at home and elsewhere."""

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
from planner.check.surroundings import check_collision, check_workspace
from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.robot.collision import Collisions
from planner.robot.config import WorkspaceTable
from planner.robot.link_bodies import LinkBody, link_bodies
from planner.robot.robot import Robot

POSES = 4  # poses looked at where no workspace is stated
TRIES = 60  # poses tried to find them


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
    middle = (robot.lower_rad + robot.upper_rad) / 2
    return np.where((robot.lower_rad <= 0) & (robot.upper_rad >= 0), 0.0, middle)


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
