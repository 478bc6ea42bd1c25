"""Answer of `predict`: modes and FRFs with their uncertainty at given poses."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Group
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.campaign.planned import inside, outside_remark
from planner.export.npz import save_frfs
from planner.report.answer import Answer
from planner.report.text import table, with_sd
from planner.words import counted

if TYPE_CHECKING:
    from planner.surrogate.frf_bands import ModalPrediction


@dataclass(frozen=True)
class ExpectedMode:
    """A mode as the model predicts it.

    `sd_hz` is what a new visit to the pose would show, the scatter from visit to visit included;
    the modal analysis' own sd of that measurement is not.
    """

    frequency_hz: float
    sd_hz: float
    damping_ratio: float
    damping_sd: float

    @classmethod
    def all_of(cls, prediction: "ModalPrediction", i: int) -> "tuple[ExpectedMode, ...]":
        """All modes of the i-th pose of a prediction."""
        p = prediction
        columns = p.frequency_hz[i], p.frequency_sd_hz[i], p.damping_ratio[i], p.damping_sd[i]
        return tuple(cls(*map(float, numbers)) for numbers in zip(*columns, strict=True))

    @property
    def cells(self) -> tuple[str, str]:
        """Frequency (Hz) and damping (%) as a table shows them; what is not known is no number."""
        damping = with_sd(100 * self.damping_ratio, 100 * self.damping_sd)
        if not self.damping_sd < self.damping_ratio:
            damping = "not known"
        return with_sd(self.frequency_hz, self.sd_hz), damping


@dataclass(frozen=True)
class PosePrediction:
    """The modes expected at a pose, from the lowest; whether it lies `outside` the workspace."""

    pose: str
    modes: tuple[ExpectedMode, ...]
    outside: bool = False


@dataclass(frozen=True)
class PredictionReport(Answer):
    """Answer of `predict`; `npz` is the file with the FRFs, `measurements` how many poses count."""

    poses: tuple[PosePrediction, ...]
    npz: str
    measurements: int

    def text(self) -> Group:
        """A table of modes, and which poses lie where nobody asked the model to be good."""
        made = table(
            f"After {counted(self.measurements, 'measured pose')}",
            *("pose", "mode", "frequency (Hz)", "damping (%)"),
        )
        for pose in self.poses:
            for k, mode in enumerate(pose.modes):
                name = f"{pose.pose} (outside)" if pose.outside else pose.pose
                made.add_row(name if k == 0 else "", str(k + 1), *mode.cells)
        said = outside_remark([pose.pose for pose in self.poses if pose.outside])
        told = [Text(said, style="yellow")] if said else []
        return Group(made, *told, Text(f"FRFs (m/s²/N) with sd: {self.npz}"))


def predictions(
    campaign: Campaign, names: Sequence[str], q: Sequence[np.ndarray], npz: Path
) -> PredictionReport:
    """Predict at n poses q, (dof,) in rad each; FRFs go to the npz file.

    Raises InputError where that cannot be written.
    """
    angles, lines = np.array(q), campaign.frequency_lines
    prediction, (mean, sd) = campaign.model.predict(angles), campaign.frf_at(angles)
    outside = ~inside(campaign.cell, angles)
    save_frfs(npz, lines, mean, sd, names, campaign.cell.robot.joints, angles, outside)
    poses = (
        PosePrediction(name, ExpectedMode.all_of(prediction, i), bool(outside[i]))
        for i, name in enumerate(names)
    )
    return PredictionReport(tuple(poses), str(npz.resolve()), len(campaign.state.used))
