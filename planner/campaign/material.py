"""What a diagnosis is given: a folder of recordings and a robot, or a campaign."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.campaign import store
from planner.campaign.campaign import Campaign
from planner.campaign.table import write_table
from planner.errors import InputError
from planner.recording.records import PoseRow

OFFERED = 200  # of a campaign's candidates, evenly spread, that are looked at


@dataclass(frozen=True, eq=False)
class Material:
    """Recordings, robot.toml, the analyser's window rate, and poses that could be measured next.

    `offered` (n, dof) in rad, with their names; empty where none are known.
    """

    recordings: Path
    robot: Path
    window_rate_1_s: float
    offered: np.ndarray
    names: tuple[str, ...]

    def with_poses(self, rows: tuple[PoseRow, ...]) -> "Material":
        """The same with the poses of a table, unless a campaign offers its own."""
        if len(self.offered) or not rows:
            return self
        q = np.deg2rad(np.array([row.joints_deg for row in rows]))
        names = tuple(row.pose for row in rows)
        return Material(self.recordings, self.robot, self.window_rate_1_s, q, names)


def material(folder: Path, robot: Path | None, window_rate_1_s: float) -> Material:
    """Of a recordings folder, or of a campaign: then robot, window and poses are its own.

    Raises InputError where the robot is missing.
    """
    if not (folder / store.CONFIG).is_file():
        if robot is None:
            raise InputError(f"{folder} is no campaign; name the robot with --robot ROBOT_TOML.")
        return Material(folder, robot, window_rate_1_s, np.zeros((0, 0)), ())
    campaign = Campaign(folder)
    cell = campaign.cell
    recordings = write_table(campaign.directory, campaign.state, cell.robot.joint_names)
    chosen = np.flatnonzero(cell.allowed)[:OFFERED]
    names = tuple(f"candidate {i + 1}" for i in chosen)
    path = robot or campaign.directory / cell.config.robot
    rate = window_rate_1_s or cell.config.modes.window_rate_1_s
    return Material(recordings, path, rate, cell.candidates.q[chosen], names)
