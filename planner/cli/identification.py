"""What a simulation is told by recordings (`planner identify`, `planner diagnose`)."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import RECORDED, AsJson, RobotOption, refusals, respond


def identify(
    recordings: Annotated[Path, typer.Argument(metavar="RECORDINGS", help=f"{RECORDED}.")],
    robot: RobotOption = None,
    out: Annotated[
        Path | None, typer.Option(metavar="ROBOT_TOML", help="Write the identified robot here.")
    ] = None,
    inertias: Annotated[
        bool, typer.Option(help="Let masses and inertias err by 8 %, centres of mass by 1 cm.")
    ] = True,
    extend: Annotated[
        bool,
        typer.Option(help="Look for what robot.toml leaves out where its springs are not enough."),
    ] = True,
    held_out: Annotated[
        int | None, typer.Option(min=0, metavar="N", help="Poses to judge by (default: 1 of 4).")
    ] = None,
    band_hz: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="LOW HIGH", help="Band in Hz, instead of robot.toml's."),
    ] = None,
    window_rate_1_s: Annotated[
        float,
        typer.Option("--window-rate", metavar="1/S", help="Of the analyser's exponential window."),
    ] = 0.0,
    plot: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Draw FRFs before and after into it.")
    ] = None,
    format_: Annotated[str, typer.Option("--format", help="Of the pictures: png or svg.")] = "png",
    rrd: Annotated[Path | None, typer.Option(help="Write a Rerun recording to this file.")] = None,
    as_json: AsJson = False,
) -> int:
    """Fit stiffness and damping of a robot's simulation to recorded hits.

    Example: planner identify exports --robot robot/robot.toml --out found/robot.toml
    """
    from planner.api import identify as fit
    from planner.campaign.material import material
    from planner.cli.progress import telling
    from planner.fit.write_robot import check_target
    from planner.report.modal_analysis import check_options
    from planner.report.pictures import Pictures

    started = time.perf_counter()
    check_options(band_hz, window_rate_1_s=window_rate_1_s)
    pictures, given = Pictures(plot, format_, rrd), material(recordings, robot, window_rate_1_s)
    nominal = given.nominal
    if out is not None:
        check_target(out, nominal)
    band = band_hz or nominal.config.band_hz
    with telling("identifying", quiet=as_json) as progress:
        dataset = given.read(nominal, band, progress)
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
    recordings: Annotated[Path, typer.Argument(metavar="RECORDINGS", help=f"{RECORDED}.")],
    robot: RobotOption = None,
    predict: Annotated[
        Path | None, typer.Option(metavar="POSES_CSV", help="Poses whose FRFs are wanted.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Write robot, FRFs and pictures here.")
    ] = None,
    window_rate_1_s: Annotated[
        float,
        typer.Option("--window-rate", metavar="1/S", help="Of the analyser's exponential window."),
    ] = 0.0,
    as_json: AsJson = False,
) -> int:
    """Locate where simulation and recordings differ, name the missing physics, show the fit.

    Example: planner diagnose cell7 --out found
    """
    from planner.api import diagnose_material
    from planner.campaign.material import material
    from planner.cli.progress import telling
    from planner.recording.folder import peak_forces, read_poses
    from planner.report.modal_analysis import check_options
    from planner.report.status import model_beside

    started = time.perf_counter()
    check_options(window_rate_1_s=window_rate_1_s)
    given = material(recordings, robot, window_rate_1_s)
    nominal = given.nominal
    wanted = read_poses(predict, nominal.joints) if predict else ()
    with telling("diagnosing", quiet=as_json) as tell:
        answer = diagnose_material(given.with_poses(wanted), nominal, tell)
        if predict:
            q = nominal.joints.internal([row.joints_deg for row in wanted])
            npz = _target(out, predict, given.recordings)
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


def _target(out: Path | None, predict: Path, recordings: Path) -> Path:
    """Where predictions go: FOLDER, or beside the recordings' folder."""
    folder = out if out is not None else recordings.absolute().parent / "predictions"
    return folder.absolute() / f"{predict.stem}.npz"
