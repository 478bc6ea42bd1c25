"""Modal analysis of a recordings folder with several poses (`planner modes FOLDER`)."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from planner.dataset.measure import measure
from planner.dataset.screened_files import Source
from planner.errors import RefusedError
from planner.modal.modes import Mode
from planner.modal.tracking import Guide, Tracks, track
from planner.recording.folder import joint_columns, read_recordings
from planner.recording.records import PoseRow, RecordingsFolder
from planner.report.plot_files import Pictures

ABOVE = 2  # labels of the simulation above the modes of the pose that has most


@dataclass(frozen=True, eq=False)
class Survey:
    """Modes of n poses, which of them are the same, and what the simulation says of each."""

    poses: tuple[str, ...]
    tracks: Tracks
    simulated_hz: np.ndarray | None  # (n, k)
    refused: tuple[dict[str, str], ...]
    simulated: bool

    @property
    def frequency_sd_hz(self) -> np.ndarray:
        """(n, k), NaN where a label was not found."""
        rows = [[m.frequency_sd_hz if m else np.nan for m in row] for row in self.tracks.modes]
        return np.array(rows, dtype=float).reshape(self.tracks.probability.shape)


def analyse(
    folder: Path,
    band_hz: tuple[float, float],
    robot_toml: Path | None,
    estimator: str,
    window_rate_1_s: float,
    pictures: Pictures,
    progress: Callable[[str], None],
) -> dict[str, Any]:
    """Answer of `modes` for a folder; labels follow the simulation's families if a robot is named.

    Raises RefusedError where no pose gives a mode.
    """
    table = _table(folder, robot_toml)
    names = tuple(dict.fromkeys(row.pose for row in table.rows))
    found, refused, simulated = [], [], False
    for number, name in enumerate(names):
        progress(f"pose {name}, {number} of {len(names)} done")
        rows = [row for row in table.rows if row.pose == name]
        measured = measure(_sources(rows), band_hz, estimator, window_rate_1_s)
        refused += [
            {"file": v.source.name, "reason": v.reason} for v in measured.verdicts if not v.accepted
        ]
        simulated |= any(v.simulated for v in measured.verdicts)
        found.append(measured.modal.modes if measured.modal else ())
    if not any(found):
        raise RefusedError(
            f"{folder}: no pose gives a mode between {band_hz[0]:g} and "
            f"{band_hz[1]:g} Hz; see `planner modes` of one pose's files."
        )
    first = {row.pose: row for row in reversed(table.rows)}
    q = np.deg2rad(np.array([first[name].joints_deg for name in names]))
    tracks, expected = _labelled(found, q, robot_toml)
    survey = Survey(names, tracks, expected, tuple(refused), simulated)
    return _answer(survey, band_hz, folder, pictures)


def _table(folder: Path, robot_toml: Path | None) -> RecordingsFolder:
    if robot_toml is None:
        return read_recordings(folder, joint_columns(folder))
    from planner.robot.robot import Robot

    return read_recordings(folder, Robot.load(robot_toml).joint_names)


def _sources(rows: list[PoseRow]) -> tuple[Source, ...]:
    return tuple(Source(r.file, str(r.file), r.hit, r.repeat) for r in rows if r.file)


def _labelled(
    found: list[tuple[Mode, ...]], q: np.ndarray, robot_toml: Path | None
) -> tuple[Tracks, np.ndarray | None]:
    span = np.ptp(q, axis=0)
    x = ((q - q.min(axis=0)) / np.where(span > 0, span, 1.0))[:, span > 0]
    labels = max(map(len, found))
    if robot_toml is None:
        return track(found, Guide.by_example(found), x), None
    from planner.dynamics.simulation import Simulation
    from planner.robot.robot import Robot

    simulation = Simulation(Robot.load(robot_toml))
    middle = int(np.argmin(np.linalg.norm(x - x.mean(axis=0), axis=1)))
    count = min(labels + ABOVE, simulation.elastic.size)
    modes = simulation.followed(q, count, simulation.families(q[middle], q))
    tracks = track(found, Guide(modes.frequency_hz, modes.shape, middle), x)
    return tracks, modes.frequency_hz


def _answer(
    survey: Survey, band_hz: tuple[float, float], folder: Path, pictures: Pictures
) -> dict[str, Any]:
    tracks = survey.tracks
    poses = [
        {
            "pose": name,
            "modes": [
                _mode(mode, k + 1, tracks.probability[i, k])
                for k, mode in enumerate(tracks.modes[i])
                if mode is not None
            ],
            "unlabelled": [_mode(mode, None, None) for mode in tracks.unexpected[i]],
        }
        for i, name in enumerate(survey.poses)
    ]
    drawn: dict[str, Any] = {"plots": [], "rrd": None}
    if pictures.wanted:
        from planner.report.modal_plots import frequency_figure

        seen = np.any(np.isfinite(tracks.frequency_hz), axis=0)
        mark = "SIMULATED recordings · " if survey.simulated else ""
        figure = frequency_figure(
            survey.poses,
            tracks.frequency_hz[:, seen],
            survey.frequency_sd_hz[:, seen],
            None if survey.simulated_hz is None else survey.simulated_hz[:, seen],
            title=f"{mark}Campbell diagram · {folder.name}",
        )
        drawn = pictures.write({"campbell": figure}, folder.name)
    return {
        "poses": poses,
        "modes": poses[0]["modes"],
        "band_hz": list(band_hz),
        "refused": list(survey.refused),
        "remarks": [],
        "simulated": survey.simulated,
        **drawn,
    }


def _mode(mode: Mode, label: int | None, probability: float | None) -> dict[str, Any]:
    return {
        "label": label,
        "label_probability": probability,
        "frequency_hz": mode.frequency_hz,
        "frequency_sd_hz": mode.frequency_sd_hz,
        "damping_ratio": mode.damping_ratio,
        "damping_sd": mode.damping_sd,
        "shape": [[s.real, s.imag] for s in mode.shape],
        "probability": mode.probability,
    }
