"""Experimental modal analysis of recorded hits (`planner modes`)."""

from pathlib import Path
from typing import Annotated

from planner.cli.answer import (
    AsJson,
    FromNames,
    PictureFormat,
    Rrd,
    WindowRate,
    argument,
    option,
    progress_bar,
    refusals,
    respond,
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
    given = None if force else frf_set(sources, band_hz, estimator, window_rate_1_s)
    if given is not None and given.placed:
        answer = modal_analysis.matrix_report(given, quantity, pictures, real, export)
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
