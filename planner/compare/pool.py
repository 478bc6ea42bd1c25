"""The pool: every recorded pose with its modes and FRFs, made from its hits once and kept."""

from collections.abc import Sequence
from dataclasses import dataclass

from planner.campaign.config import ModesTable
from planner.campaign.labels import from_modal
from planner.campaign.state import Measurement
from planner.dataset.measure import MeasuredPose
from planner.dataset.screened_files import Source
from planner.dataset.visits import Recording
from planner.errors import RefusedFile
from planner.frf.frf import Frf
from planner.recording.joints import JointUnits


@dataclass(frozen=True, eq=False)
class PoolPose:
    """A recorded pose; `frf` is None where no hit could be used, `reason` why there are no modes.

    `reason` is empty where there are.
    """

    measurement: Measurement
    frf: Frf | None
    refused: tuple[RefusedFile, ...]
    reason: str
    simulated: bool


@dataclass(frozen=True)
class PoseFiles:
    """One recorded pose with its joints (°, mm) and files, and how modes are found."""

    pose: str
    joints_deg: tuple[float, ...]
    files: tuple[Source, ...]
    table: ModesTable

    @property
    def measured(self) -> MeasuredPose:
        """Its recordings, read when something is asked that the user's store does not hold."""
        table = self.table
        return MeasuredPose(self.files, table.band_hz, window_rate_1_s=table.window_rate_1_s)


def poses_of(
    recordings: Sequence[Recording], joints: JointUnits, table: ModesTable
) -> tuple[PoseFiles, ...]:
    """The poses of recordings in recorded order."""
    groups: dict[str, list[Recording]] = {}
    for one in recordings:
        groups.setdefault(one.pose, []).append(one)
    found = []
    for pose, own in groups.items():
        stood = tuple(round(float(value), 9) for value in joints.shown(own[0].q))
        found.append(PoseFiles(pose, stood, tuple(one.source for one in own), table))
    return tuple(found)


def make(_: None, pose: PoseFiles) -> PoolPose:
    """Turn the hits of a pose into modes and FRFs, or take those that were kept."""
    found = pose.measured
    modes = from_modal(found.modal)
    refused = tuple(RefusedFile(v.source.name, v.reason) for v in found.verdicts if not v.accepted)
    reason = "" if modes else (found.remarks[-1] if found.remarks else "No mode was found.")
    return PoolPose(
        Measurement(pose.pose, pose.joints_deg, (), modes, found.remarks),
        found.frf,
        refused,
        reason,
        any(v.simulated for v in found.verdicts),
    )
