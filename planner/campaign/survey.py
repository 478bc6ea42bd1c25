"""Modes of a recordings folder with several poses: which of them are the same."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.campaign.hit_errors import CampaignHitErrors, Visited, estimate
from planner.campaign.labels import ABOVE
from planner.campaign.low_fidelity import LowFidelity, identify_low_fidelity
from planner.dataset.hit_columns import hits_of
from planner.dataset.measure import DEFAULT_BAND_HZ, MeasuredPose, measure
from planner.dataset.screened_files import Source, in_parts
from planner.dynamics.simulation import Simulation
from planner.errors import RefusedError, RefusedFile
from planner.fit.identified_robot import IdentifiedRobot
from planner.frf.frf import Frf
from planner.measurement.measured_frfs import common_band
from planner.measurement.nuisances import Tolerances
from planner.measurement.point_places import misplaced
from planner.measurement.sensor_loading import WithoutSensors, without_sensors
from planner.modal.modes import Mode
from planner.modal.tracking import Guide, Tracks, track
from planner.progress import ProgressCallback
from planner.recording.folder import joint_columns, read_recordings
from planner.recording.records import PoseRow
from planner.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class Survey:
    """Labelled modes of named poses in a band (Hz); `bare` holds what sensors had lowered.

    `simulated_hz` (n, k) are the labels' simulated frequencies, None without a robot; `hit_errors`
    how hits departed from their points and axes.
    """

    poses: tuple[str, ...]
    tracks: Tracks
    bare: WithoutSensors
    hit_errors: CampaignHitErrors
    band_hz: tuple[float, float]
    refused: tuple[RefusedFile, ...]
    remarks: tuple[str, ...]
    simulated: bool
    simulated_hz: np.ndarray | None


def survey(
    folder: Path,
    band_hz: tuple[float, float] | None,
    robot_toml: Path | None,
    estimator: str,
    window_rate_1_s: float,
    progress: ProgressCallback,
) -> Survey:
    """Analyse each pose; labels follow the simulation's families if a robot is named.

    Raises RefusedError where no pose gives a mode.
    """
    band, robot = band_hz or DEFAULT_BAND_HZ, Robot.load(robot_toml) if robot_toml else None
    joints = joint_columns(folder) if robot is None else robot.joints
    rows: dict[str, list[PoseRow]] = {}
    for row in read_recordings(folder, joints, None if robot is None else robot.points):
        rows.setdefault(row.pose, []).append(row)
    names, q = tuple(rows), joints.internal([own[0].joints_deg for own in rows.values()])
    every: list[MeasuredPose] = []
    visited: list[tuple[Visited, Frf]] = []
    for number, (name, own) in enumerate(rows.items()):
        progress(f"pose {name}", number / len(names))
        sources = tuple(Source.of(row) for row in own if row.file)
        measured = measure(in_parts(sources), band, estimator, window_rate_1_s)
        every.append(measured)
        if robot is not None and measured.frf is not None:
            visited.append(_visited(name, q[number], measured))
    found = [one.modal.modes if one.modal else () for one in every]
    verdicts = [verdict for one in every for verdict in one.verdicts]
    refused = tuple(RefusedFile(v.source.name, v.reason) for v in verdicts if not v.accepted)
    if not any(found):
        reasons = [file.reason for file in refused] + [
            told for one in every for told in one.remarks
        ]
        raise RefusedError(
            f"{folder}: no pose gives a mode between {band[0]:g} and {band[1]:g} Hz: {reasons[0]}"
        )
    nominal = None if robot is None else Simulation(robot)
    errors = _hit_errors(visited, nominal, band)
    found = [tuple(errors.without_hit_errors(*one)) for one in zip(names, found, strict=True)]
    simulations = [] if nominal is None else [nominal]  # as stated, then as identified
    if errors.fitted is not None and errors.trusted:
        simulations.append(errors.fitted.simulation)
    doubts = _doubts(names, simulations, q, every, band)
    bare = without_sensors(names, found, simulations, q, every)
    tracks, expected = _labelled(bare.modes, q, nominal)
    return Survey(
        names, tracks, bare, errors, band, refused, (*doubts, *bare.remarks),
        any(v.simulated for v in verdicts), expected,
    )  # fmt: skip


def _visited(pose: str, q: np.ndarray, measured: MeasuredPose) -> tuple[Visited, Frf]:
    """A pose whose FRF is known, with what each accepted hit says; its FRFs at all points."""
    sources = tuple(v.source for v in measured.verdicts if v.accepted)
    hits = hits_of(sources, measured.band_hz, measured.window_rate_1_s)
    assert measured.frf is not None
    files = tuple(source.name for source in sources)
    return Visited(q, hits.columns, pose, files, measured.frf), hits.whole


def _hit_errors(
    visited: list[tuple[Visited, Frf]], nominal: Simulation | None, band: tuple[float, float]
) -> CampaignHitErrors:
    """By the robot's simulation, identified from these recordings; none without a robot."""
    if nominal is None or not visited:
        return CampaignHitErrors((), None, Tolerances(), band)
    visits, whole = zip(*visited, strict=True)
    fit = _learned(nominal, whole, np.array([one.q for one in visits]), band)
    return estimate(visits, fit, fit.posterior.tolerances, band)


def _learned(
    nominal: Simulation, frfs: Sequence[Frf], q: np.ndarray, band: tuple[float, float]
) -> IdentifiedRobot:
    """What FRFs at q (n, dof) in rad tell of a robot, within the tolerances that it states."""
    t = Tolerances.of(nominal.robot.config, nominal.robot.joints.slides)
    fit = identify_low_fidelity(LowFidelity(1, nominal, t), frfs, q, band).identified_robot
    assert fit is not None
    return fit


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
    poses = [names[i] for i in index]
    found = misplaced(simulations, q[index], frfs, usable, poses)
    tool = [(i, frf.of_tool) for i, frf in zip(index, frfs, strict=True)]
    known = [(i, frf) for i, frf in tool if frf is not None]
    if found and known:
        # What was identified from wrongly named points too is spoiled: from the tool's alone.
        at, frfs_of_tool = zip(*known, strict=True)
        fit = _learned(simulations[0], frfs_of_tool, q[list(at)], band)
        tried = [*simulations, fit.identified.simulation]
        found = misplaced(tried, q[index], frfs, usable, poses)
    return found


def _labelled(
    found: Sequence[tuple[Mode, ...]], q: np.ndarray, simulation: Simulation | None
) -> tuple[Tracks, np.ndarray | None]:
    span = np.ptp(q, axis=0)
    x = ((q - q.min(axis=0)) / np.where(span > 0, span, 1.0))[:, span > 0]
    labels = max(map(len, found))
    if simulation is None:
        return track(found, Guide.by_example(found), x), None
    middle = int(np.argmin(np.linalg.norm(x - x.mean(axis=0), axis=1)))
    count = min(labels + ABOVE, simulation.elastic.size)
    modes = simulation.followed(q, count, simulation.families(q[middle], q))
    tracks = track(found, Guide(modes.frequency_hz, modes.shape, middle), x)
    return tracks, modes.frequency_hz
