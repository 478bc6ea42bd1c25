"""What recordings of several poses come from: folders and a robot, or a campaign."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.campaign import store
from planner.campaign.campaign import Campaign
from planner.campaign.proposals import MOST_INFORMED
from planner.dataset.dataset import Dataset
from planner.dataset.visits import Recording, recordings_in, unlisted_folders
from planner.errors import InputError
from planner.progress import ProgressCallback
from planner.recording.folder import TABLE
from planner.recording.records import PoseRow
from planner.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class RecordingsSource:
    """Recordings, their robot, the analyser's window rate, and poses that could be measured next.

    `recordings` is their folder, in which a `campaign` keeps its own. `offered` are joint angles
    (dof,) in rad by name; empty where none are known.
    """

    recordings: Path
    robot: Robot
    window_rate_1_s: float
    offered: Mapping[str, np.ndarray]
    campaign: Campaign | None = None

    @property
    def listed(self) -> tuple[Recording, ...]:
        """Every file with its pose, in the order of recording; a campaign's accepted ones.

        Raises InputError where there are none, or a table is wrong.
        """
        if self.campaign is None:
            return recordings_in(self.recordings, self.robot.joints, self.robot.points)
        return self.campaign.used_recordings

    def unlisted(self, listed: Sequence[Recording]) -> tuple[str, ...]:
        """Which folders are left out because no table lists their recordings, in a sentence."""
        return () if self.campaign else unlisted_folders(self.recordings, listed)

    def read(self, band_hz: tuple[float, float], progress: ProgressCallback) -> Dataset:
        """What is `listed`, read and screened; nothing is written. Raises as `Dataset.of` does."""
        how = {"window_rate_1_s": self.window_rate_1_s, "progress": progress}
        if self.campaign is not None:
            return self.campaign.dataset(band_hz, **how)
        return Dataset.read(self.recordings, self.robot, band_hz, **how)

    def with_poses(self, rows: tuple[PoseRow, ...]) -> "RecordingsSource":
        """The same with the poses of a table, unless a campaign offers its own."""
        listed = {row.pose: self.robot.joints.internal(row.joints_deg) for row in rows}
        return replace(self, offered=self.offered or listed)


def recordings_source(folder: Path, robot: Path | None, window_rate_1_s: float) -> RecordingsSource:
    """Of recordings as `recordings_in` takes them, or of a campaign.

    Robot, window and poses are then its own, the robot with what campaign.toml adds.

    Raises InputError where the robot is missing.
    """
    if not (folder / store.CONFIG).is_file():
        if robot is None:
            raise InputError(f"{folder} is no campaign; name the robot with --robot ROBOT_TOML.")
        recordings = folder.parent if folder.name == TABLE else folder
        return RecordingsSource(recordings, Robot.load(robot), window_rate_1_s, {})
    campaign = Campaign(folder)
    cell = campaign.cell
    chosen = np.flatnonzero(cell.allowed)[:MOST_INFORMED]
    offered = {f"candidate {i + 1}": cell.candidates.q[i] for i in chosen}
    own = robot is None or robot == campaign.robot_toml
    loaded = cell.robot if own else Robot.load(robot)
    rate = window_rate_1_s or cell.config.modes.window_rate_1_s
    recordings = campaign.directory / store.RECORDINGS
    return RecordingsSource(recordings, loaded, rate, offered, campaign)
