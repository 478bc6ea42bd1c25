"""The pool: every recorded pose with its modes and FRFs, made from its hits once and kept."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.campaign.config import ModesTable
from planner.campaign.measured_modes import from_modal
from planner.campaign.state import Measurement
from planner.dataset.measure import MeasuredPose
from planner.dataset.screened_files import Source
from planner.dataset.store import Store, user_store
from planner.dataset.visits import Recording
from planner.frf.frf import Frf
from planner.recording.joints import JointUnits


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
    """One recorded pose with its joints (°, mm) and files, and how modes are found."""

    pose: str
    joints_deg: tuple[float, ...]
    files: tuple[Source, ...]
    table: ModesTable

    def measured(self, store: Store) -> MeasuredPose:
        """Its recordings, read when something is asked that `store` does not hold."""
        rate = self.table.window_rate_1_s
        return MeasuredPose(self.files, self.table.band_hz, window_rate_1_s=rate, store=store)


def poses_of(
    recordings: Sequence[Recording], joints: JointUnits, table: ModesTable
) -> tuple[PoseFiles, ...]:
    """The poses of recordings in recorded order."""
    groups: dict[str, list[Recording]] = {}
    for one in recordings:
        groups.setdefault(one.pose, []).append(one)
    return tuple(
        PoseFiles(pose, _stood(joints, own[0].q), tuple(one.source for one in own), table)
        for pose, own in groups.items()
    )


def _stood(joints: JointUnits, q: np.ndarray) -> tuple[float, ...]:
    return tuple(round(float(value), 9) for value in joints.shown(q))


def kept(pose: PoseFiles) -> bool:
    """Whether modes and FRFs were found before."""
    return pose.measured(user_store()).is_kept


def make(_: None, pose: PoseFiles) -> PoolPose:
    """Turn the hits of a pose into modes and FRFs, or take those that were kept."""
    found = pose.measured(user_store())
    modes = from_modal(found.modal)
    refused = tuple(Refusal(v.source.name, v.reason) for v in found.verdicts if not v.accepted)
    reason = "" if modes else (found.remarks[-1] if found.remarks else "No mode was found.")
    return PoolPose(
        Measurement(pose.pose, pose.joints_deg, (), modes, found.remarks),
        found.frf,
        refused,
        reason,
        any(v.simulated for v in found.verdicts),
    )
