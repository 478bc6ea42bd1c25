"""What recordings tell (`planner modes`, `identify`, `diagnose`, `compare`)."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from planner.cli.answer import (
    RECORDED,
    AsJson,
    FromNames,
    PictureFormat,
    RobotOption,
    Rrd,
    WindowRate,
    argument,
    option,
    progress_bar,
    refusals,
    respond,
    warn,
)
from planner.errors import InputError


def modes(
    paths: Annotated[list[Path], argument("Hits or FRFs, of a pose or of any points.", "PATH...")],
    band_hz: Annotated[tuple[float, float] | None, option("Band in Hz.", "LOW HIGH")] = None,
    force: Annotated[str | None, option("Force channel, if not labelled.", "CHANNEL")] = None,
    quantity: Annotated[
        str | None, option("Of unlabelled FRFs: accelerance, mobility or receptance.", "KIND")
    ] = None,
    estimator: Annotated[str, option("h1, h2 or hv.")] = "h1",
    window_rate_1_s: WindowRate = 0.0,
    robot: Annotated[
        Path | None, option("Whose simulation guides labels over poses.", "ROBOT_TOML")
    ] = None,
    plot: Annotated[Path | None, option("Draw the analysis into this folder.", "FOLDER")] = None,
    format_: PictureFormat = "png",
    rrd: Rrd = None,
    real: Annotated[
        bool, option("Of any points: real normal modes as shapes.", None, "--real")
    ] = False,
    export: Annotated[
        Path | None, option("Of any points: write UFF and CSV files here.", "FOLDER")
    ] = None,
    operating: Annotated[
        bool, option("Responses alone, no force: unscaled modes.", None, "--operating")
    ] = False,
    from_names: FromNames = False,
    as_json: AsJson = False,
) -> int:
    """Experimental modal analysis: hits or FRFs, of a pose or any points; a recordings folder.

    Example: planner modes exports/P001/*.uff --plot pictures
    """
    from planner.dataset.frf_set import frf_set
    from planner.recording.folder import several_poses
    from planner.report import modal_analysis
    from planner.report.pictures import Pictures

    modal_analysis.check_options(band_hz, estimator, quantity, window_rate_1_s)
    pictures = Pictures(plot, format_, rrd)
    for_points = [
        name
        for name, given in (("--real", real), ("--export", export), ("--operating", operating))
        if given
    ]
    if several_poses(paths, least=1 if robot else 2):
        from planner.campaign.survey import survey
        from planner.report.modes import survey_report

        if for_points:
            raise InputError(f"{paths[0]} holds several poses; leave {for_points[0]} out.")
        given = paths[0], band_hz, robot, estimator, window_rate_1_s
        with progress_bar("identifying", quiet=as_json) as progress:
            answer = survey_report(survey(*given, progress), pictures, paths[0].name)
        return respond(answer, as_json, refusals(answer.keys["refused"]))
    if operating:
        return respond(modal_analysis.operating_report(paths, band_hz, pictures), as_json)
    sources = modal_analysis.sources_of(paths, from_names)
    given = None if force else frf_set(sources, band_hz, estimator, window_rate_1_s, quantity)
    if given is not None and given.matrix is not None:
        answer = modal_analysis.matrix_report(given, given.matrix, pictures, real, export)
    elif for_points:
        what = "FRFs without directions" if given else "hits of one pose"
        raise InputError(
            f"{paths[0]} holds {what}, and {for_points[0]} is for FRFs of any points; leave it out."
        )
    elif given is not None:
        answer = modal_analysis.unlabelled_report(given, quantity, pictures)
    else:
        answer = modal_analysis.modal_report(
            sources, band_hz, force, estimator, pictures, window_rate_1_s
        )
    return respond(answer, as_json, refusals(answer.keys["refused"]))


def identify(
    recordings: Annotated[Path, argument(f"{RECORDED}.", "RECORDINGS")],
    robot: RobotOption = None,
    out: Annotated[Path | None, option("Write the identified robot here.", "ROBOT_TOML")] = None,
    inertias: Annotated[
        bool, option("Let masses and inertias err by 8 %, centres of mass by 1 cm.")
    ] = True,
    extend: Annotated[
        bool, option("Look for what robot.toml leaves out where its springs are not enough.")
    ] = True,
    held_out: Annotated[
        int | None, option("Poses to judge by (default: 1 of 4).", "N", min=0)
    ] = None,
    band_hz: Annotated[
        tuple[float, float] | None, option("Band in Hz, instead of robot.toml's.", "LOW HIGH")
    ] = None,
    window_rate_1_s: WindowRate = 0.0,
    plot: Annotated[Path | None, option("Draw FRFs before and after into it.", "FOLDER")] = None,
    format_: PictureFormat = "png",
    rrd: Rrd = None,
    as_json: AsJson = False,
) -> int:
    """Fit stiffness and damping of a robot's simulation to recorded hits.

    Example: planner identify exports --robot robot/robot.toml --out found/robot.toml
    """
    from planner.api import identify as fit
    from planner.campaign.recordings_source import recordings_source
    from planner.fit.write_robot import check_target
    from planner.report.modal_analysis import check_options
    from planner.report.pictures import Pictures

    started = time.perf_counter()
    check_options(band_hz, window_rate_1_s=window_rate_1_s)
    pictures = Pictures(plot, format_, rrd)
    given = recordings_source(recordings, robot, window_rate_1_s)
    nominal = given.robot
    if out is not None:
        check_target(out, nominal)
    band = band_hz or nominal.config.band_hz
    with progress_bar("identifying", quiet=as_json) as progress:
        dataset = given.read(band, progress)
        answer = fit(
            dataset,
            nominal,
            band_hz=band,
            inertias=inertias,
            extend=extend,
            held_out=held_out,
            progress=progress,
        )
    answer = answer.with_pictures(pictures)
    if out is not None:
        answer = answer.write(out)
    answer = replace(answer, seconds=time.perf_counter() - started)
    return respond(answer, as_json, refusals(answer.refused))


def diagnose(
    recordings: Annotated[Path, argument(f"{RECORDED}.", "RECORDINGS")],
    robot: RobotOption = None,
    predict: Annotated[Path | None, option("Poses whose FRFs are wanted.", "POSES_CSV")] = None,
    out: Annotated[Path | None, option("Write robot, FRFs and pictures here.", "FOLDER")] = None,
    window_rate_1_s: WindowRate = 0.0,
    as_json: AsJson = False,
) -> int:
    """Locate where simulation and recordings differ, name the missing physics, show the fit.

    Example: planner diagnose cell7 --out found
    """
    from planner.api import diagnose_source
    from planner.campaign.recordings_source import recordings_source
    from planner.recording.folder import peak_forces, read_poses
    from planner.report.modal_analysis import check_options
    from planner.report.status import model_beside

    started = time.perf_counter()
    check_options(window_rate_1_s=window_rate_1_s)
    given = recordings_source(recordings, robot, window_rate_1_s)
    nominal = given.robot
    wanted = read_poses(predict, nominal.joints) if predict else ()
    with progress_bar("diagnosing", quiet=as_json) as progress:
        answer = diagnose_source(given.with_poses(wanted), progress)
        if predict:
            q = nominal.joints.internal([row.joints_deg for row in wanted])
            beside = given.recordings.absolute().parent / "predictions"
            npz = (out or beside).absolute() / f"{predict.stem}.npz"
            force_n = peak_forces(wanted)
            answer = answer.with_predictions([row.pose for row in wanted], q, npz, force_n)
        if out is not None:
            answer = answer.write(out)
    if given.campaign is not None and robot is None:
        both = model_beside(given.campaign, answer.to_json())
        said = (*answer.remarks, *filter(None, (both,)))
        answer = replace(answer, remarks=said, campaign_robot=given.campaign.robot_toml)
    answer = replace(answer, seconds=time.perf_counter() - started)
    return respond(answer, as_json, refusals(answer.refused))


SIMULATIONS = ("frozen", "updated", "none")


def compare(
    recordings: Annotated[Path, argument(f"{RECORDED}: the pool.", "RECORDINGS")],
    strategies: Annotated[
        str | None, option("random, sobol, maximin_lhs, default, variance, …", "A,B,…")
    ] = None,
    models: Annotated[
        str | None, option("default, gp, ar1, nargp, mfdgp, multitask, none.", "A,B,…")
    ] = None,
    robot: RobotOption = None,
    repeats: Annotated[int, option("Seeds.", min=1, max=10000)] = 20,
    initial: Annotated[
        int, option("First poses, the same for all strategies at a seed.", min=1)
    ] = 3,
    budget: Annotated[
        int | None, option("Measurements (default: 15, or what the pool allows).", min=1)
    ] = None,
    simulation: Annotated[str | None, option("frozen, updated or none.", "USE")] = None,
    scheduler: Annotated[
        str | None, option("Of a Dask cluster that does the runs.", "ADDRESS")
    ] = None,
    workers: Annotated[int, option("Processes on this machine.", min=1, max=256)] = 2,
    campaign: Annotated[
        Path | None, option("Workspace, modes, acquisition.", "CAMPAIGN_TOML")
    ] = None,
    out: Annotated[Path | None, option("Where results and the picture go.", "FOLDER")] = None,
    rrd: Rrd = None,
    as_json: AsJson = False,
) -> int:
    """Compare sampling strategies: error by number of measurements, on poses not used.

    `--models` compares models of the frequencies, as `[surrogate] model` names them.

    Example: planner compare exports --robot robot/robot.toml --strategies random,default
    """
    from planner import content_hash
    from planner.campaign import store
    from planner.campaign.recordings_source import recordings_source
    from planner.compare.bench import assemble, comparison_config
    from planner.compare.resume import conduct, recorded
    from planner.compare.tasks import Study
    from planner.report.comparison import comparison
    from planner.report.pictures import Pictures

    started = time.perf_counter()
    if simulation not in (None, *SIMULATIONS):
        raise InputError(f"--simulation {simulation} is not known; give {', '.join(SIMULATIONS)}.")
    given = recordings_source(recordings, robot, 0.0)
    loaded, listed = given.robot, given.listed
    if campaign is None and given.campaign is not None:
        campaign = given.campaign.directory / store.CONFIG
    config = comparison_config(loaded, listed, campaign, simulation)
    try:
        folder = out or content_hash.cache_folder("compare")
    except RuntimeError:
        what = "There is no home folder to keep results in; name one with --out."
        raise InputError(what) from None
    with progress_bar("comparing", quiet=as_json) as progress:
        poses = recorded(listed, loaded.joints, config.modes, workers, progress)
        bench, remarks = assemble(loaded, config, poses)
        study = Study.plan(bench, strategies, models, repeats, initial, budget)
        found, damaged = conduct(bench, study, folder, scheduler, workers, progress)
    told = (*given.unlisted(listed), *remarks, *damaged)
    answer = comparison(bench, study, found, poses, told, Pictures(out, rrd=rrd), started)
    for one in answer.keys["failed"]:
        warn(f"The run of {one['strategy']} with seed {one['seed']} failed: {one['reason']}")
    return respond(answer, as_json)
