"""The pool: every recorded pose with its modes and FRFs, made from its hits once and kept."""

from dataclasses import dataclass
from pathlib import Path

from planner.campaign.config import ModesTable
from planner.campaign.log_conversion import from_modal
from planner.campaign.state import Measurement
from planner.dataset.measure import MeasuredPose
from planner.dataset.screened_files import Source
from planner.dataset.store import Store, user_store
from planner.frf.frf import Frf
from planner.recording.folder import read_recordings
from planner.recording.records import PoseRow
from planner.robot.robot import Robot


@dataclass(frozen=True)
class Refusal:
    """A file that could not be used, and why."""

    file: str
    reason: str


@dataclass(frozen=True, eq=False)
class PoolPose:
    """A recorded pose; `frf` is None where no hit could be used, `reason` why there are no modes.

    `reason` is empty where there are.
    """

    measurement: Measurement
    frf: Frf | None
    refused: tuple[Refusal, ...]
    reason: str
    simulated: bool


@dataclass(frozen=True)
class PoseFiles:
    """One pose of recordings.csv with its files, and how modes are found."""

    rows: tuple[PoseRow, ...]
    table: ModesTable

    def measured(self, store: Store) -> MeasuredPose:
        """Its recordings, read when something is asked that `store` does not hold."""
        files = tuple(Source.of(r) for r in self.rows if r.file)
        rate = self.table.window_rate_1_s
        return MeasuredPose(files, self.table.band_hz, window_rate_1_s=rate, store=store)


def poses_of(folder: Path, robot: Robot, table: ModesTable) -> tuple[PoseFiles, ...]:
    """The poses of a recordings folder in recorded order; InputError where it is wrong."""
    groups: dict[str, list[PoseRow]] = {}
    for row in read_recordings(folder, robot.joints, robot.points).rows:
        groups.setdefault(row.pose, []).append(row)
    return tuple(PoseFiles(tuple(rows), table) for rows in groups.values())


def kept(pose: PoseFiles) -> bool:
    """Whether modes and FRFs were found before."""
    return pose.measured(user_store()).is_kept


def make(_: None, pose: PoseFiles) -> PoolPose:
    """Turn the hits of a pose into modes and FRFs, or take those that were kept."""
    first, found = pose.rows[0], pose.measured(user_store())
    modes = from_modal(found.modal)
    refused = tuple(Refusal(v.source.name, v.reason) for v in found.verdicts if not v.accepted)
    reason = "" if modes else (found.remarks[-1] if found.remarks else "No mode was found.")
    return PoolPose(
        Measurement(first.pose, first.joints_deg, (), modes, found.remarks),
        found.frf,
        refused,
        reason,
        any(v.simulated for v in found.verdicts),
    )
