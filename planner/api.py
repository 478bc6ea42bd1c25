"""What scripts call: modal analysis, identification and diagnosis as functions of typed values."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from planner.campaign.recordings_source import RecordingsSource
from planner.dataset.dataset import Dataset
from planner.dataset.measure import DEFAULT_BAND_HZ, measure
from planner.dataset.screened_files import in_parts
from planner.design.discrimination import extra_sensor, next_hit, tied
from planner.diagnosis.diagnose import explain
from planner.diagnosis.odd_pose import odd_pose
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import CAD_INERTIAS, Priors
from planner.errors import InputError, RefusedError
from planner.fit.held_out import identify_judged
from planner.frf.estimator import estimate
from planner.frf.frf import Frf
from planner.modal.estimate_modes import estimate_modes
from planner.modal.modes import ModalModel
from planner.progress import ProgressCallback, no_progress
from planner.recording.records import Hit
from planner.report.diagnosis import DiagnosisReport, diagnosis_report
from planner.report.identification import IdentificationReport, identification_report
from planner.report.modal_analysis import check_options, sources_of
from planner.robot.robot import Robot


def analyse(
    source: "Frf | Dataset | Path | str | Sequence[Hit] | Sequence[Path | str]",
    *,
    pose: str | None = None,
    band_hz: tuple[float, float] | None = None,
    estimator: str = "h1",
    window_rate_1_s: float = 0.0,
) -> ModalModel:
    """Experimental modal analysis of one pose.

    Args:
        source: An FRF matrix, hits, files or folders of recordings of one pose, or a dataset.
        pose: Which pose of a dataset.
        band_hz: In which modes are looked for; by default the dataset's, else 4 to 60 Hz.
        estimator: "h1", "h2" or "hv", for hits and files.
        window_rate_1_s: Of an exponential window e^(−rate·t), in 1/s, that the analyser laid over
            all channels of hits and files; damping comes out without it.

    Returns:
        The modes, increasing in frequency, with standard deviations: frequencies in Hz, damping
        ratios, shapes (3,), residues (3, 3) in m/(N·s).

    Raises:
        InputError: The source or an option makes no sense.
        RefusedError: No recording can be used, or no mode is found.
    """
    check_options(band_hz, estimator, None, window_rate_1_s)
    band = band_hz or (source.band_hz if isinstance(source, Dataset) else DEFAULT_BAND_HZ)
    with threadpool_limits(1):
        if isinstance(source, Dataset):
            return estimate_modes(_frf_of(source, pose), band)
        if pose is not None:
            raise InputError("A pose is named, but only a Dataset has several.")
        if isinstance(source, Frf):
            return estimate_modes(source, band)
        given = [source] if isinstance(source, Path | str) else list(source)
        if not given:
            raise InputError("There is nothing to analyse; give hits or files of one pose.")
        hits = [one for one in given if isinstance(one, Hit)]
        if len(hits) == len(given):
            frf = replace(
                estimate(tuple(hits), band, estimator), exponential_rate_1_s=window_rate_1_s
            )
            return estimate_modes(frf, band)
        paths = [Path(one) for one in given if isinstance(one, Path | str)]
        if len(paths) < len(given):
            raise InputError("Hits and files are mixed; give one kind.")
        measured = measure(in_parts(sources_of(paths)), band, estimator, window_rate_1_s)
        if measured.modal is None:
            reasons = [v.reason for v in measured.verdicts if not v.accepted]
            reason = (reasons or list(measured.remarks))[0]
            raise RefusedError(f"No modes could be identified: {reason}")
        return measured.modal


def identify(
    dataset: Dataset,
    robot: Robot,
    *,
    band_hz: tuple[float, float] | None = None,
    inertias: bool = True,
    extend: bool = True,
    held_out: int | None = None,
    progress: ProgressCallback = no_progress,
) -> IdentificationReport:
    """Fit the elastic parameters of a robot's simulation to recorded FRFs of several poses.

    The fit is judged at poses held out, and then done again with all of them. What hits, measuring
    chain and readback leave open, as robot.toml states it, is integrated out.

    Args:
        dataset: FRFs at q (n, dof) in rad.
        robot: The robot whose [[compliance]] blocks are fitted.
        band_hz: Which part of the FRFs is fitted; by default robot.toml's.
        inertias: Whether masses and inertias may err by 8 %, centres of mass by 1 cm.
        extend: Whether what robot.toml leaves out (a floor or bearings that give way, links that
            bend, masses, resonators) is looked for where its springs do not explain the FRFs.
        held_out: How many poses to judge by; by default one of four.
        progress: Is told what is being done; the share that is done is not known, 0.

    Returns:
        Stiffness in N·m/rad and damping in N·m·s/rad with standard deviations, the agreement
        before and after, and the identified `simulation`; `write` makes a robot.toml of it.

    Raises:
        InputError: Nothing of the FRFs lies in the band, or no pose is left to fit.
        RefusedError: No pose of the dataset has a hit that can be used.
    """
    started, band = time.perf_counter(), band_hz or robot.config.band_hz
    check_options(band_hz)
    nominal, priors = Simulation(robot), CAD_INERTIAS if inertias else Priors()
    with threadpool_limits(1):
        judged = identify_judged(
            dataset.one_hit_frfs,
            dataset.q,
            nominal,
            priors,
            held_out,
            dataset.frfs,
            band_hz=band,
            extend=extend,
            on_step=lambda text: progress(text, 0.0),
        )
        made = identification_report(dataset, judged, nominal, band, inertias)
    return replace(made, seconds=time.perf_counter() - started)


def diagnose(
    dataset: Dataset,
    robot: Robot,
    *,
    offered: Mapping[str, np.ndarray] | None = None,
    progress: ProgressCallback = no_progress,
) -> DiagnosisReport:
    """Locate where a robot's simulation and recordings differ, and name the missing physics.

    Args:
        dataset: FRFs at q (n, dof) in rad, and the hits themselves where there are any.
        robot: The robot as stated; its own parameters are refitted under every hypothesis.
        offered: Poses that could be measured next, by name: joint angles (dof,) in rad.
        progress: Is told what is being done, and which share (0 to 1) of the whole is.

    Returns:
        The verdict, findings with probabilities and parameters, the agreement at poses held out,
        and the next hit, or the place of one more sensor, that would tell apart what is tied;
        `predict` gives FRFs.

    Raises:
        InputError: Nothing of the FRFs lies in robot.toml's band.
        RefusedError: No pose of the dataset has a hit that can be used.
    """
    started = time.perf_counter()
    with threadpool_limits(1):
        found = explain(dataset, Simulation(robot), progress)
        left, poses = tied(found), offered or {}
        hit, sensor = next_hit(found, left, poses), extra_sensor(found, left, poses)
        made = diagnosis_report(found, odd_pose(found))
    return replace(made, next=hit, next_sensor=sensor, seconds=time.perf_counter() - started)


def diagnose_source(
    given: RecordingsSource, progress: ProgressCallback = no_progress
) -> DiagnosisReport:
    """As `diagnose`, of what a folder of recordings or a campaign holds."""
    band_hz = given.robot.config.band_hz
    dataset = given.read(band_hz, lambda text, share: progress(text, 0.0))
    return diagnose(dataset, given.robot, offered=given.offered, progress=progress)


def _frf_of(dataset: Dataset, pose: str | None) -> Frf:
    if pose not in dataset.poses:
        known = ", ".join(dataset.poses)
        raise InputError(f"Pose {pose} is not among those of the dataset; name one of {known}.")
    return dataset.frfs[dataset.poses.index(pose)]
