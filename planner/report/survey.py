"""Answer of `modes` for a recordings folder with several poses: which modes are the same."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from rich.console import Group
from rich.text import Text

from planner.campaign.hit_habits import HitMiss, habits
from planner.campaign.low_fidelity import LowFidelity, learn
from planner.campaign.misses import CampaignMisses, Visited, told_by
from planner.dataset.hit_columns import hits_of
from planner.dataset.measure import MeasuredPose, measure
from planner.dataset.screened_files import Source, in_parts
from planner.dynamics.simulation import Simulation
from planner.errors import RefusedError
from planner.frf.frf import Frf
from planner.measurement.measured_frfs import common_band
from planner.measurement.nuisances import Tolerances
from planner.measurement.point_places import misplaced, questions
from planner.modal.modes import Mode
from planner.modal.tracking import Guide, Tracks, track
from planner.recording.folder import joint_columns, read_recordings
from planner.recording.records import PoseRow, RecordingsFolder
from planner.report.answer import NOT_IN_JSON, Answer, RefusedFile
from planner.report.modal_analysis import DEFAULT_BAND_HZ, IdentifiedMode
from planner.report.plot_files import Pictures
from planner.report.sensor_masses import WithoutSensors, without_sensors
from planner.report.text import SIMULATED, SIMULATED_TITLE, drawn, remarks, table
from planner.robot.robot import Robot
from planner.words import counted

ABOVE = 2  # labels of the simulation above the modes of the pose that has most
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


def survey(
    folder: Path,
    band_hz: tuple[float, float] | None,
    robot_toml: Path | None,
    estimator: str,
    window_rate_1_s: float,
    progress: Callable[[str], None],
) -> SurveyReport:
    """Analyse each pose; labels follow the simulation's families if a robot is named.

    Raises RefusedError where no pose gives a mode.
    """
    band = band_hz or DEFAULT_BAND_HZ
    table = _table(folder, robot_toml)
    names = tuple(dict.fromkeys(row.pose for row in table.rows))
    found, every, refused, simulated = [], [], [], False
    visited: list[tuple[Visited, Frf]] = []
    for number, name in enumerate(names):
        progress(f"pose {name}, {number} of {len(names)} done")
        rows = [row for row in table.rows if row.pose == name]
        measured = measure(in_parts(_sources(rows)), band, estimator, window_rate_1_s)
        refused += [
            RefusedFile(v.source.name, v.reason) for v in measured.verdicts if not v.accepted
        ]
        simulated |= any(v.simulated for v in measured.verdicts)
        found.append(measured.modal.modes if measured.modal else ())
        every.append(measured)
        if robot_toml is not None and measured.frf is not None:
            q = table.joints.internal(rows[0].joints_deg)
            visited.append(_visited(name, q, measured))
    if not any(found):
        reasons = [file.reason for file in refused] + [
            told for one in every for told in one.remarks
        ]
        raise RefusedError(
            f"{folder}: no pose gives a mode between {band[0]:g} and {band[1]:g} Hz: {reasons[0]}"
        )
    first = {row.pose: row for row in reversed(table.rows)}
    q = table.joints.internal([first[name].joints_deg for name in names])
    misses = _misses(visited, robot_toml, band)
    found = [tuple(misses.without_misses(*one)) for one in zip(names, found, strict=True)]
    simulations = _simulations(misses, robot_toml)
    doubts = _doubts(names, simulations, q, every, band)
    bare = without_sensors(names, found, simulations, q, every)
    tracks, expected = _labelled(bare.modes, q, robot_toml)
    poses = tuple(_pose(name, tracks, i, bare) for i, name in enumerate(names))
    hits = tuple(hit for pose in misses.poses for hit in pose.hits)
    return SurveyReport(
        poses, poses[0].modes, band, tuple(refused), (*doubts, *bare.remarks), simulated,
        hit_errors=hits, habits=habits(hits), tracks=tracks, simulated_hz=expected,
    )  # fmt: skip


def _table(folder: Path, robot_toml: Path | None) -> RecordingsFolder:
    if robot_toml is None:
        return read_recordings(folder, joint_columns(folder))
    robot = Robot.load(robot_toml)
    return read_recordings(folder, robot.joints, robot.points)


def _sources(rows: list[PoseRow]) -> tuple[Source, ...]:
    return tuple(Source.of(r) for r in rows if r.file)


def _visited(pose: str, q: np.ndarray, measured: MeasuredPose) -> tuple[Visited, Frf]:
    """A pose whose FRF is known, with what each accepted hit says; its FRFs at all points."""
    sources = tuple(v.source for v in measured.verdicts if v.accepted)
    hits = hits_of(sources, measured.band_hz, measured.window_rate_1_s)
    assert measured.frf is not None
    files = tuple(source.name for source in sources)
    return Visited(pose, files, q, hits.columns, measured.frf), hits.whole


def _misses(
    visited: list[tuple[Visited, Frf]], robot_toml: Path | None, band: tuple[float, float]
) -> CampaignMisses:
    """By the robot's simulation, identified from these recordings; none without a robot."""
    if robot_toml is None or not visited:
        return CampaignMisses((), None, Tolerances(), band)
    robot = Robot.load(robot_toml)
    visits, whole = zip(*visited, strict=True)
    return told_by(Simulation(robot), visits, whole, _tolerances(robot), band)


def _tolerances(robot: Robot) -> Tolerances:
    return Tolerances.of(robot.config, robot.joints.slides)


def _simulations(misses: CampaignMisses, robot_toml: Path | None) -> list[Simulation]:
    """As stated, and as identified from the recordings where that was done."""
    if robot_toml is None:
        return []
    told = [misses.told.simulation] if misses.told is not None and misses.trusted else []
    return [Simulation(Robot.load(robot_toml)), *told]


def _doubts(
    names: Sequence[str],
    simulations: Sequence[Simulation],
    q: np.ndarray,
    measured: Sequence[MeasuredPose],
    band: tuple[float, float],
) -> tuple[str, ...]:
    """Questions about points whose FRFs a simulation describes far better elsewhere."""
    index = [i for i, one in enumerate(measured) if one.whole is not None]
    frfs = [one.whole for one in measured if one.whole is not None]
    if not simulations or not frfs:
        return ()
    usable = common_band(frfs, band)
    found = misplaced(simulations, q[index], frfs, usable)
    tool = [(i, frf.of_tool) for i, frf in zip(index, frfs, strict=True)]
    known = [(i, frf) for i, frf in tool if frf is not None]
    if found and known:
        # What was identified from wrongly named points too is spoiled: from the tool's alone.
        nominal = LowFidelity(1, simulations[0], _tolerances(simulations[0].robot))
        learned = learn(nominal, [frf for _, frf in known], q[[i for i, _ in known]], band).learned
        if learned is not None:
            tried = [*simulations, learned.identified.simulation]
            found = misplaced(tried, q[index], frfs, usable)
    return questions(found, [names[i] for i in index])


def _labelled(
    found: Sequence[tuple[Mode, ...]], q: np.ndarray, robot_toml: Path | None
) -> tuple[Tracks, np.ndarray | None]:
    span = np.ptp(q, axis=0)
    x = ((q - q.min(axis=0)) / np.where(span > 0, span, 1.0))[:, span > 0]
    labels = max(map(len, found))
    if robot_toml is None:
        return track(found, Guide.by_example(found), x), None
    simulation = Simulation(Robot.load(robot_toml))
    middle = int(np.argmin(np.linalg.norm(x - x.mean(axis=0), axis=1)))
    count = min(labels + ABOVE, simulation.elastic.size)
    modes = simulation.followed(q, count, simulation.families(q[middle], q))
    tracks = track(found, Guide(modes.frequency_hz, modes.shape, middle), x)
    return tracks, modes.frequency_hz


def _pose(name: str, tracks: Tracks, i: int, bare: WithoutSensors) -> SurveyedPose:
    modes = tuple(
        SurveyedMode.of(mode, k + 1, float(tracks.probability[i, k]), bare.of(i, mode))
        for k, mode in enumerate(tracks.modes[i])
        if mode is not None
    )
    others = (SurveyedMode.of(m, lowered_percent=bare.of(i, m)) for m in tracks.unexpected[i])
    return SurveyedPose(name, modes, tuple(others))
