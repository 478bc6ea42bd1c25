"""Depths and speeds at which a cut is stable (`planner stability`)."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import AsJson, respond


def stability(
    source: Annotated[
        Path,
        typer.Argument(metavar="SOURCE", help="npz of predict, UFF FRFs, a campaign, modes TOML."),
    ],
    cut: Annotated[Path, typer.Option("--cut", metavar="CUT_TOML", help="Cutter and cut.")],
    pose: Annotated[
        str | None, typer.Option(metavar="NAME", help="Of the source's poses; all: each.")
    ] = None,
    path: Annotated[
        Path | None,
        typer.Option(metavar="POSES_CSV", help="Of a campaign: all these poses, as in predict."),
    ] = None,
    tool: Annotated[
        Path | None, typer.Option(metavar="TOOL_TOML", help="Put this tool on, as couple does.")
    ] = None,
    reference: Annotated[
        Path | None, typer.Option(metavar="TOOL_TOML", help="The tested tool, taken off before.")
    ] = None,
    robot: Annotated[
        Path | None, typer.Option(metavar="ROBOT_TOML", help="Tells how the tip turns; see couple.")
    ] = None,
    point: Annotated[
        str | None, typer.Option(metavar="RPM,DEPTH_M", help="How stable is this very point?")
    ] = None,
    samples: Annotated[int, typer.Option(min=20, max=10_000, help="Of what is uncertain.")] = 200,
    plot: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Draw the lobes into this folder.")
    ] = None,
    format_: Annotated[str, typer.Option("--format", help="Of the picture: png or svg.")] = "png",
    rrd: Annotated[Path | None, typer.Option(help="Write a Rerun recording to this file.")] = None,
    as_json: AsJson = False,
) -> int:
    """To which depth a cut is stable at each spindle speed, and how it chatters beyond.

    Example: planner stability cell7 --pose P001 --cut cut.toml --plot pictures
    """
    from planner.cli.progress import counting
    from planner.report.plot_files import Pictures
    from planner.report.stability_of import Asked, stability_of

    if path is not None or pose == "all":
        from planner.milling.cut import load_cut
        from planner.report.stability_path import path_report

        with counting(quiet=as_json) as tell:
            found = path_report(
                source, path, load_cut(cut), samples, Pictures(plot, format_, rrd), tell
            )
        return respond(found, as_json)
    asked = Asked(source, cut, pose, point, samples, tool, reference, robot)
    pictures = Pictures(plot, format_, rrd)
    with counting(quiet=as_json) as tell:
        answer = stability_of(asked, pictures, tell)
    return respond(answer, as_json)
