"""What is handed on: measured and predicted FRFs and modes, pose by pose."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.campaign.campaign import Campaign
from planner.campaign.events import MeasuredMode
from planner.frf.frf import Frf
from planner.recording.joints import JointUnits
from planner.surrogate.frf_bands import ModalPrediction


@dataclass(frozen=True, eq=False)
class MeasuredPoseData:
    """A measured pose: joint angles in degrees (mm of slides), FRFs, likely modes."""

    pose: str
    joints_deg: tuple[float, ...]
    frf: Frf
    modes: tuple[MeasuredMode, ...]


@dataclass(frozen=True, eq=False)
class ExportData:
    """All of a campaign that other programs can use: measured poses, and the model at n `poses`.

    There with joints (n, dof) in degrees or mm, modes, FRFs (n, 3, 3, F) with sd in m/s²/N.
    """

    name: str
    joints: JointUnits
    simulated: bool
    measured: tuple[MeasuredPoseData, ...]
    poses: tuple[str, ...]
    joints_deg: np.ndarray
    frequency_hz: np.ndarray
    frf_mean: np.ndarray
    frf_sd: np.ndarray
    modes: ModalPrediction

    @property
    def label(self) -> str:
        """What stands first in every file."""
        return f"{'SIMULATED ' if self.simulated else ''}planner campaign {self.name}"


def export_data(
    campaign: Campaign, poses: Sequence[str], joints_deg: Sequence[Sequence[float]]
) -> ExportData:
    """Measured poses, and the model's predictions at `poses` (none: at the measured ones)."""
    state, cell = campaign.state, campaign.cell
    used, lines = state.used, campaign.frequency_lines
    names, angles = tuple(poses), np.array(joints_deg, dtype=float)
    if not names:
        names = tuple(m.pose for m in used)
        angles = np.array([m.joints_deg for m in used])
    angles = angles.reshape(len(names), len(cell.robot.joint_names))
    if names:
        q = cell.robot.joints.internal(angles)
        mean, sd = campaign.frf_at(q, lines)
        modes = campaign.model.predict(q)
    else:
        mean, sd = np.empty((0, 3, 3, len(lines)), complex), np.empty((0, 3, 3, len(lines)))
        none = np.empty((0, cell.config.modes.count))
        modes = ModalPrediction(none, none, none, none, np.empty((*none.shape, 3, 3)), none)
    measured = (
        MeasuredPoseData(
            m.pose, m.joints_deg, campaign.frf_of(m), tuple(mode for mode in m.modes if mode.likely)
        )
        for m in used
    )
    found = tuple(measured), names, angles, lines, mean, sd, modes
    return ExportData(campaign.directory.name, cell.robot.joints, state.simulated, *found)
