"""Cuts and tools (`planner stability`, `planner couple`)."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import AsJson, FromNames, PictureFormat, Rrd, option, respond
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
    pose: Annotated[str | None, option("Of the source's poses; all: each.", "NAME")] = None,
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
    map_: Annotated[bool, option("Of a campaign: all over the workspace.", None, "--map")] = False,
    poses: Annotated[
        int | None, typer.Option(min=2, max=200, help="Of a program (12), or of --map (40).")
    ] = None,
    tool: Annotated[Path | None, option("Put this tool on, as couple does.", "TOOL_TOML")] = None,
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
    point: Annotated[str | None, option("How stable is this very point?", "RPM,DEPTH_M")] = None,
    samples: Annotated[int, typer.Option(min=20, max=10_000, help="Of what is uncertain.")] = 200,
    plot: Annotated[Path | None, option("Draw the lobes into this folder.", "FOLDER")] = None,
    format_: PictureFormat = "png",
    rrd: Rrd = None,
    from_names: FromNames = False,
    as_json: AsJson = False,
) -> int:
    """To which depth a cut is stable at each spindle speed, and how it chatters beyond.

    Example: planner stability cell7 --pose P001 --cut cut.toml --plot pictures
    """
    from planner.campaign.cut_source import StabilityRequest
    from planner.cli.progress import progress_bar
    from planner.milling.cut import load_cut
    from planner.report.pictures import Pictures

    asked = StabilityRequest(
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
    with progress_bar("computing", quiet=as_json) as progress:
        if map_:
            from planner.report.stability_map import map_report

            return respond(
                map_report(asked, poses or 40, load_cut(cut), pictures, progress), as_json
            )
        if path is not None or pose == "all":
            from planner.campaign.toolpath_poses import PathRequest
            from planner.report.stability import path_report

            way = PathRequest(path, origin, poses or 12, turns)
            return respond(path_report(asked, way, load_cut(cut), pictures, progress), as_json)
        from planner.report.stability import stability_of

        return respond(stability_of(asked, pictures, progress), as_json)


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


def couple(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="FRFs at the tested tool's tip: npz, measured (a file or folder; from one with "
            "recordings.csv those of predict.csv are predicted), or a campaign.",
        ),
    ],
    tool: Annotated[Path, typer.Option(metavar="TOOL_TOML", help="The tool that is put on.")],
    out: Annotated[Path, typer.Option(metavar="FILE.npz", help="Where its FRFs go.")],
    reference: Annotated[
        Path | None,
        typer.Option(metavar="TOOL_TOML", help="The tested tool, which is taken off."),
    ] = None,
    pose: Annotated[str | None, typer.Option(metavar="NAME", help="Which pose of SOURCE.")] = None,
    robot: Annotated[
        Path | None,
        typer.Option(metavar="ROBOT_TOML", help="Whose simulation tells how the tip turns."),
    ] = None,
    noise: Annotated[
        float,
        typer.Option(metavar="PERCENT", min=0.0, help="Of FRFs whose file states no sd."),
    ] = 0.0,
    contact_from: Annotated[
        Path | None,
        typer.Option(metavar="FRFS", help="Measured with TOOL there: its contact is identified."),
    ] = None,
    band_hz: Annotated[
        tuple[float, float] | None,
        typer.Option("--band-hz", metavar="LOW HIGH", help="Band in Hz, which has to be covered."),
    ] = None,
    plot: Annotated[Path | None, option("Draw the FRFs into this folder.", "FOLDER")] = None,
    format_: PictureFormat = "png",
    rrd: Rrd = None,
    from_names: FromNames = False,
    as_json: AsJson = False,
) -> int:
    """Predict the FRFs of another tool: the tested one is taken off, the other put on.

    Example: planner couple predictions/poses.npz --tool long.toml --out long.npz
    """
    from planner.campaign.cut_source import fitted_contact, tip_of, within
    from planner.milling.coupling import couple as coupling
    from planner.milling.tool import load_tool
    from planner.report.coupling import coupling_report
    from planner.report.pictures import Pictures

    pictures = Pictures(plot, format_, rrd)
    target = load_tool(tool)
    tested = None if reference is None else load_tool(reference)
    tip, name = tip_of(source, tested, pose, robot, noise / 100, from_names)
    tip = within(tip, band_hz, source)
    contact = None
    if contact_from is not None:
        contact = fitted_contact(tip, target, tested, contact_from, pose)
        target = contact.tool
    before, coupled = coupling(tip, None), coupling(tip, target, tested)
    tested_name = None if tested is None else tested.name
    answer = coupling_report(before, coupled, target.name, tested_name, name, out)
    if contact is not None:
        answer = replace(answer, contact=contact.to_json())
    return respond(answer.with_pictures(pictures, f"{answer.tool} at {answer.pose}"), as_json)
