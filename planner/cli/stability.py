"""Depths and speeds at which a cut is stable (`planner stability`)."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import AsJson, FromNames, respond
from planner.errors import InputError


def stability(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="npz of predict, FRFs (a file or a folder), a campaign, modes TOML.",
        ),
    ],
    cut: Annotated[Path, typer.Option("--cut", metavar="CUT_TOML", help="Cutter and cut.")],
    pose: Annotated[
        str | None, typer.Option(metavar="NAME", help="Of the source's poses; all: each.")
    ] = None,
    path: Annotated[
        Path | None,
        typer.Option(metavar="CSV|PROGRAM", help="Of a campaign: poses, or G-code or APT."),
    ] = None,
    origin: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z", help="Of a program: its zero in the robot's base, m."),
    ] = None,
    turns: Annotated[
        bool, typer.Option("--turns", help="Along --path: turn the robot about the tool's axis.")
    ] = False,
    map_: Annotated[
        bool, typer.Option("--map", help="Of a campaign: all over the workspace.")
    ] = False,
    poses: Annotated[
        int | None, typer.Option(min=2, max=200, help="Of a program (12), or of --map (40).")
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
    noise: Annotated[
        float, typer.Option(metavar="PERCENT", min=0.0, help="With --tool: of FRFs without sd.")
    ] = 0.0,
    peak_force_n: Annotated[
        float | None,
        typer.Option(
            "--peak-force-n",
            metavar="N",
            min=1e-3,
            help="Of a campaign: linearise joints that are not linear ([[law]]) for such hits.",
        ),
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
    from_names: FromNames = False,
    as_json: AsJson = False,
) -> int:
    """To which depth a cut is stable at each spindle speed, and how it chatters beyond.

    Example: planner stability cell7 --pose P001 --cut cut.toml --plot pictures
    """
    from planner.campaign.cut_source import Asked
    from planner.cli.progress import telling
    from planner.milling.cut import load_cut
    from planner.report.pictures import Pictures

    asked = Asked(
        source,
        cut,
        pose,
        point,
        samples,
        tool,
        reference,
        robot,
        noise / 100,
        from_names,
        peak_force_n,
    )
    pictures = Pictures(plot, format_, rrd)
    check(path, origin, turns, poses, map_, pose)
    with telling("computing", quiet=as_json) as tell:
        if map_:
            from planner.report.stability_map import map_report

            return respond(map_report(asked, poses or 40, load_cut(cut), pictures, tell), as_json)
        if path is not None or pose == "all":
            from planner.campaign.toolpath_poses import Way
            from planner.report.stability import path_report

            way = Way(path, origin, poses or 12, turns)
            return respond(path_report(asked, way, load_cut(cut), pictures, tell), as_json)
        from planner.report.stability import stability_of

        return respond(stability_of(asked, pictures, tell), as_json)


def check(
    path: Path | None, origin: str | None, turns: bool, poses: int | None, map_: bool,
    pose: str | None,
) -> None:  # fmt: skip
    """InputError where options contradict each other."""
    if map_ and (path is not None or pose is not None):
        raise InputError("--map looks all over the workspace; leave --path and --pose out.")
    if path is not None and pose is not None:
        raise InputError("--path names the poses; leave --pose out.")
    if path is None and (origin is not None or turns):
        raise InputError("--origin and --turns go with --path; name the path.")
    if poses is not None and not map_ and path is None:
        raise InputError("--poses goes with --map or a program as --path; add one of them.")
