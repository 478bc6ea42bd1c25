"""Diagnosis of recordings that differ from the simulation (`planner diagnose`)."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import RECORDED, AsJson, RobotOption, refusals, respond


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
    from planner.cli.progress import counting
    from planner.recording.folder import read_poses
    from planner.report.modal_analysis import check_options
    from planner.report.status import model_beside

    started = time.perf_counter()
    check_options(window_rate_1_s=window_rate_1_s)
    given = material(recordings, robot, window_rate_1_s)
    nominal = given.nominal
    wanted = read_poses(predict, nominal.joints) if predict else ()
    with counting(quiet=as_json) as tell:
        answer = diagnose_material(given.with_poses(wanted), nominal, tell)
        if predict:
            q = nominal.joints.internal([row.joints_deg for row in wanted])
            npz = _target(out, predict, given.recordings)
            answer = answer.with_predictions([row.pose for row in wanted], q, npz)
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
