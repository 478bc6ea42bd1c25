"""Answer of `modes` for a recordings folder with several poses: which modes are the same."""

from dataclasses import dataclass, field, replace

import numpy as np
from rich.console import Group
from rich.text import Text

from planner.campaign.hit_habits import HitMiss, habits
from planner.campaign.survey import Survey
from planner.modal.modes import Mode
from planner.modal.tracking import Tracks
from planner.report.answer import NOT_IN_JSON, Answer, RefusedFile
from planner.report.modal_analysis import IdentifiedMode
from planner.report.plot_files import Pictures
from planner.report.text import SIMULATED, SIMULATED_TITLE, drawn, remarks, table
from planner.words import counted

SURE = 0.9  # probability of a label below which the text marks it as doubtful


@dataclass(frozen=True)
class SurveyedMode:
    """A mode of a pose; `label` counts the modes of all poses from 1, None where it has none.

    `sensors_lowered_percent` is what the sensors' masses had lowered its frequency by, which is
    given without them; None where the simulation has no such mode.
    """

    label: int | None
    label_probability: float | None
    frequency_hz: float
    frequency_sd_hz: float
    damping_ratio: float
    damping_sd: float
    shape: tuple[tuple[float, float], ...]
    probability: float
    residue: tuple[tuple[float, float, float], ...]
    sensors_lowered_percent: float | None = 0.0

    @classmethod
    def of(
        cls,
        mode: Mode,
        label: int | None = None,
        sure: float | None = None,
        lowered_percent: float | None = 0.0,
    ) -> "SurveyedMode":
        """Of a mode of a modal model."""
        own = vars(IdentifiedMode.of(mode))
        return cls(label, sure, **own, sensors_lowered_percent=lowered_percent)

    @property
    def cell(self) -> str:
        """Frequency (Hz) as the table shows it."""
        doubt = "" if self.label_probability is None or self.label_probability >= SURE else " ?"
        return f"{self.frequency_hz:.2f}{doubt}"


@dataclass(frozen=True)
class SurveyedPose:
    """The modes of a pose, by label, and those without."""

    pose: str
    modes: tuple[SurveyedMode, ...]
    unlabelled: tuple[SurveyedMode, ...]


@dataclass(frozen=True, eq=False)
class SurveyReport(Answer):
    """Answer of `modes` of a folder; `modes` are those of the first pose."""

    poses: tuple[SurveyedPose, ...]
    modes: tuple[SurveyedMode, ...]
    band_hz: tuple[float, float]
    refused: tuple[RefusedFile, ...]
    remarks: tuple[str, ...]
    simulated: bool
    plots: tuple[str, ...] = ()
    rrd: str | None = None
    hit_errors: tuple[HitMiss, ...] = ()
    habits: tuple[str, ...] = ()
    tracks: Tracks | None = field(default=None, repr=False, metadata=NOT_IN_JSON)
    simulated_hz: np.ndarray | None = field(
        default=None, repr=False, metadata=NOT_IN_JSON
    )  # (n, k), None without a robot

    def with_pictures(self, pictures: Pictures, name: str) -> "SurveyReport":
        """The same once frequencies are drawn pose by pose, where that is wanted."""
        if not pictures.wanted or self.tracks is None:
            return self
        from planner.report.modal_plots import frequency_figure

        tracks, expected = self.tracks, self.simulated_hz
        rows = [[m.frequency_sd_hz if m else np.nan for m in row] for row in tracks.modes]
        sd = np.array(rows, dtype=float).reshape(tracks.probability.shape)
        seen = np.any(np.isfinite(tracks.frequency_hz), axis=0)
        mark = SIMULATED_TITLE if self.simulated else ""
        figure = frequency_figure(
            tuple(pose.pose for pose in self.poses),
            tracks.frequency_hz[:, seen],
            sd[:, seen],
            None if expected is None else expected[:, seen],
            title=f"{mark}Campbell diagram · {name}",
        )
        return replace(self, **pictures.write({"campbell": figure}, name))

    def text(self) -> Group:
        """Frequencies by pose and label."""
        labels = sorted({mode.label for pose in self.poses for mode in pose.modes if mode.label})
        low, high = self.band_hz
        made = table(
            f"Modes of {counted(len(self.poses), 'pose')} between {low:g} and {high:g} Hz",
            *("pose", *(f"mode {label} (Hz)" for label in labels), "without label (Hz)"),
        )
        for pose in self.poses:
            by_label = {mode.label: mode.cell for mode in pose.modes}
            others = "  ".join(mode.cell for mode in pose.unlabelled)
            made.add_row(pose.pose, *(by_label.get(label, "–") for label in labels), others)
        parts = [made, Text("  ?: the label is less than 90 % sure."), *drawn(self.plots)]
        parts += [Text(f"  {habit}") for habit in self.habits]
        parts += remarks(self.remarks)
        return Group(*parts, SIMULATED) if self.simulated else Group(*parts)


def survey_report(found: Survey) -> SurveyReport:
    """Of the labelled modes of all poses."""
    tracks, bare = found.tracks, found.bare
    poses = []
    for i, name in enumerate(found.poses):
        modes = tuple(
            SurveyedMode.of(mode, k + 1, float(tracks.probability[i, k]), bare.of(i, mode))
            for k, mode in enumerate(tracks.modes[i])
            if mode is not None
        )
        others = (SurveyedMode.of(m, lowered_percent=bare.of(i, m)) for m in tracks.unexpected[i])
        poses.append(SurveyedPose(name, modes, tuple(others)))
    hits = tuple(hit for pose in found.misses.poses for hit in pose.hits)
    return SurveyReport(
        tuple(poses), poses[0].modes, found.band_hz, found.refused, found.remarks, found.simulated,
        hit_errors=hits, habits=habits(hits), tracks=tracks, simulated_hz=found.simulated_hz,
    )  # fmt: skip
