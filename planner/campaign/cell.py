"""What stays the same while a campaign is measured: robot, simulation, workspace, candidates."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from planner.campaign.config import CampaignConfig, load_campaign_config
from planner.campaign.low_fidelity import LowFidelity
from planner.check.examine import Examination, Plan, examine
from planner.design.cost import Cost
from planner.design.propose import check_name
from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.measurement.nuisances import Tolerances
from planner.milling.cut import Cut, load_cut
from planner.robot.collision import Collisions
from planner.robot.inverse_kinematics import singularity, solve
from planner.robot.robot import Robot
from planner.robot.workspace import Candidates, Workspace
from planner.surrogate.frequency_models import check_choice

BESIDE = 0.01  # rad or m beyond the workspace that a readback may be: still inside
# A pose of a workspace of positions is reached as planned if inverse kinematics from one of the
# planned poses nearest in place, NEIGHBOURS of them, leads to it within NEAR rad (m). Joints that
# are free besides differ among these poses as well: by so much, FARTHER times, they may. On the
# shipped plane and on a box with rotation, 300 of 300 further poses as planned were inside, and
# 160 of 160 with wrist or elbow turned over were not.
NEIGHBOURS, NEAR, FARTHER = 6, 0.05, 2.0
PLACED = 6  # joints that a place and a direction of the tool take


@dataclass(frozen=True, eq=False)
class Cell:
    """Robot, simulation (None when the campaign uses none) and workspace of one campaign."""

    config: CampaignConfig
    robot: Robot
    simulation: Simulation | None
    workspace: Workspace

    @classmethod
    def load(cls, robot: Path | Robot, config: CampaignConfig) -> "Cell":
        """Of a robot, or its robot.toml, with the workspace held against it.

        Raises InputError where they disagree.
        """
        check_name(config.acquisition.name, "campaign.toml, [acquisition] name")
        chosen, simulated = config.surrogate, config.fidelity.simulation != "none"
        check_choice(chosen.model, chosen.kernel, simulated, "campaign.toml, [surrogate]")
        robot = robot if isinstance(robot, Robot) else Robot.load(robot)
        if given := config.of_the_cell():  # of hits, sensor, readback and diagnosis
            robot = replace(robot, config=msgspec.structs.replace(robot.config, **given))
        simulation = Simulation(robot) if simulated else None
        try:
            workspace = Workspace.from_table(config.workspace, robot)
        except InputError as error:  # which names an entry of the file only
            raise InputError(f"campaign.toml: {error}") from None
        cell = cls(config, robot, simulation, workspace)
        cell._check_angles()
        _ = cell.cut  # so that what is wrong with it is said here
        return cell

    def _check_angles(self) -> None:
        """Hold the joint angles that campaign.toml names against the robot; InputError."""
        config = self.config
        for where, poses in (
            ("[goal] joints_deg", config.goal.joints_deg),
            ("[acquisition] own_poses_deg", config.acquisition.own_poses_deg),
            ("[cut] joints_deg", config.cut.joints_deg if config.cut else None),
        ):
            for number, pose in enumerate(poses or (), 1):
                self.check_pose(pose, f"campaign.toml, {where}, pose {number}")
        dof = len(self.robot.joint_names)
        for zone in config.forbidden:
            if zone.joints_deg is not None and len(zone.joints_deg) != dof:
                raise InputError(
                    f"campaign.toml, [[forbidden]] joints_deg has {len(zone.joints_deg)} ranges, "
                    f"the robot {dof} joints; give one range a joint."
                )

    @cached_property
    def cut(self) -> Cut | None:
        """The cut whose stability is to be decided; None where campaign.toml names none."""
        table = self.config.cut
        if table is msgspec.UNSET:
            return None
        cut = load_cut(self.robot.path.parent / table.file)
        if table.joints_deg is None and cut.feed_in == "path":
            raise InputError(
                f'{table.file}: feed_in = "path" needs the path\'s poses; give [cut] joints_deg in '
                f"campaign.toml, or state the feed."
            )
        return cut

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """What the engineer has to know of every pose that is proposed, in sentences."""
        unchecked = Collisions(self.robot).unchecked
        return () if unchecked is None else (unchecked,)

    @cached_property
    def examined(self) -> Examination:
        """What looks wrong in the robot, for what campaign.toml asks of it."""
        return examine(self.robot, plan_of(self.config, "campaign.toml"))

    @property
    def tolerances(self) -> Tolerances:
        """Of hits and measuring chain, as robot.toml or campaign.toml state them."""
        return Tolerances.of(self.robot.config, self.robot.joints.slides)

    @cached_property
    def candidates(self) -> Candidates:
        """Reachable poses of the workspace, the same for the same configuration; then own ones."""
        own = self._own
        spread = self._spread
        if not own:
            return spread
        q = self.robot.joints.internal(own)
        collisions = Collisions(self.robot)
        q = q[[not collisions.contacts(one) for one in q]]
        return Candidates(
            np.concatenate([spread.q, q]),
            np.concatenate([spread.features, self.features(q)]),
            np.concatenate([spread.position_m, self.robot.forward_batch(q)[1]]),
            spread.rejected,
        )

    @cached_property
    def _spread(self) -> Candidates:
        return self.workspace.candidates(self.robot, self.config.acquisition.candidates, seed=0)

    @property
    def spread(self) -> int:
        """How many of the candidates, the first ones, are spread evenly over the workspace."""
        return len(self._spread.q)

    @property
    def _own(self) -> list[list[float]]:
        """Poses in degrees that are offered besides: the engineer's, and those of a cut's path."""
        own = list(self.config.acquisition.own_poses_deg or ())
        if self.config.acquisition.name == "stability" and self.config.cut is not msgspec.UNSET:
            own += [p for p in self.config.cut.joints_deg or () if p not in own]
        return own

    @cached_property
    def allowed(self) -> np.ndarray:
        """(n,) bool: which candidates may be offered; the model has to be good at all of them."""
        table, found = self.config.acquisition, self.candidates
        allowed = np.ones(len(found.q), dtype=bool)
        if table.own_only:
            allowed[: self.spread] = False
        if table.hammer_height_m is not None:
            low, high = table.hammer_height_m
            allowed &= (found.position_m[:, 2] >= low) & (found.position_m[:, 2] <= high)
        if table.singularity_margin > 0:
            allowed &= singularity(self.robot, found.q) >= table.singularity_margin
        for zone in self.config.forbidden:
            at = found.position_m if zone.position_m else self.robot.joints.shown(found.q)
            box = np.array(zone.position_m or zone.joints_deg, dtype=float)
            allowed &= ~np.all((at >= box[:, 0]) & (at <= box[:, 1]), axis=1)
        return allowed

    def features(self, q: np.ndarray) -> np.ndarray:
        """Coordinates (n, d) of poses q (n, dof) in rad that the model uses."""
        return self.workspace.features(self.robot, q)

    def inside(self, q: np.ndarray) -> np.ndarray:
        """(n,) bool: whether poses q (n, dof) in rad (m) lie in what was planned.

        That is the box of campaign.toml, the tool's direction where it states positions, and there
        the way in which the planned poses are reached: elbow, wrist and free joints.
        """
        q = np.atleast_2d(q)
        found = self.workspace.contains(self.robot, q, BESIDE)
        if self.workspace.tool_axis is not None:
            some = np.flatnonzero(found)
            for i, features in zip(some, self.features(q[some]), strict=True):
                found[i] = _reached_as_planned(self, q[i], features)
        return found

    @cached_property
    def frozen(self) -> LowFidelity:
        """The simulation as robot.toml states it."""
        return LowFidelity(self.config.modes.count, self.simulation, self.tolerances)

    @cached_property
    def cost(self) -> Cost:
        """What campaign.toml's [cost] makes of the robot's speeds."""
        table = self.config.cost
        speed = self.robot.velocity_rad_s * table.speed_share
        # A URDF may leave a speed out: a slow one is assumed, in rad/s or m/s.
        slow = np.where(self.robot.joints.slides, 0.1, 0.5)
        speed = np.where(np.isfinite(speed) & (speed > 0), speed, slow)
        per_hit, per_sensor = table.minutes_per_hit, table.minutes_per_sensor
        return Cost(speed, table.minutes_per_pose, per_hit, table.hits_per_axis, per_sensor)

    def check_pose(self, joints_deg: Sequence[float], where: str) -> np.ndarray:
        """The pose in rad (m); InputError if the robot cannot stand there."""
        return checked_pose(self.robot, joints_deg, where)

    def poses(self, joints_deg: ArrayLike) -> np.ndarray:
        """Poses (n, dof) in degrees (mm), or one of them, as q in rad (m); checked each."""
        angles = np.atleast_2d(np.asarray(joints_deg, dtype=float))
        each = enumerate(angles, 1)
        return np.array([self.check_pose(tuple(r), f"joints_deg, pose {k}") for k, r in each])


def checked_pose(robot: Robot, joints_deg: Sequence[float], where: str) -> np.ndarray:
    """The pose (dof,) in rad (m); InputError if the robot cannot stand there."""
    joints = robot.joints
    if len(joints_deg) != len(robot.joint_names):
        raise InputError(
            f"{where}: {len(joints_deg)} joint angles are given, the robot has "
            f"{len(robot.joint_names)} joints; correct the columns."
        )
    q = joints.internal(joints_deg)
    tolerance = joints.internal(joints.same())  # readback of a joint parked at its limit
    over = np.maximum(robot.lower_rad - q, q - robot.upper_rad) / tolerance
    worst = int(np.argmax(over))
    if over[worst] > 1:
        low, high = (
            joints.text(worst, joints.shown(limits)[worst])
            for limits in (robot.lower_rad, robot.upper_rad)
        )
        unit = "millimetres" if joints.slides[worst] else "degrees"
        raise InputError(
            f"{where}: {joints.names[worst]} at {joints.text(worst, joints_deg[worst], 2)} is "
            f"outside its limits of {low} to {high}; check columns and units ({unit})."
        )
    return q


def examine_robot(robot_toml: Path, campaign_toml: Path | None = None) -> Examination:
    """Check a robot, and a campaign.toml if one is named.

    Raises InputError where a file cannot be read at all.
    """
    robot = Robot.load(robot_toml)
    if campaign_toml is None:
        return examine(robot)
    return examine(robot, plan_of(load_campaign_config(campaign_toml), campaign_toml.name))


def plan_of(config: CampaignConfig, file: str) -> Plan:
    """What campaign.toml asks of a robot."""
    table, simulated = config.modes, config.fidelity.simulation != "none"
    return Plan(file, config.workspace, table.band_hz, table.count, simulated)


def refuse_errors(found: Examination) -> None:
    """InputError with the first error of a check, if there is one."""
    if found.errors:
        raise InputError(found.errors[0].sentence)


def _reached_as_planned(cell: Cell, q: np.ndarray, features: np.ndarray) -> bool:
    """Whether q (dof,) in rad, at features (d,), is on the branch of the poses planned there."""
    robot, spread = cell.robot, slice(cell.spread)
    away = np.linalg.norm(cell.candidates.features[spread] - features, axis=1)
    near = cell.candidates.q[np.argsort(away, kind="stable")[:NEIGHBOURS]]
    allowed = NEAR
    if len(q) > PLACED:
        allowed = max(NEAR, FARTHER * float(np.max(_apart(near, near[0], robot))))
    (rotation,), (position,) = robot.forward_batch(q[None])
    for start in near:
        led = solve(robot, rotation, position, start, restarts=0).q
        if led is not None and _apart(led[None], q, robot)[0] <= allowed:
            return True
    return False


def _apart(poses: np.ndarray, q: np.ndarray, robot: Robot) -> np.ndarray:
    """(n,) by how much any joint differs from q (dof,) at poses (n, dof); whole turns are none."""
    off = poses - q
    turned = np.abs((off + np.pi) % (2 * np.pi) - np.pi)
    return np.max(np.where(robot.joints.slides, np.abs(off), turned), axis=1)
