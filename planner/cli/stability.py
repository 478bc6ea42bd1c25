"""Cuts and tools (`planner stability`, `planner couple`)."""

from pathlib import Path
from typing import Annotated

import msgspec

from planner.cli.answer import (
    AsJson,
    FromNames,
    PictureFormat,
    Rrd,
    argument,
    option,
    progress_bar,
    respond,
)
from planner.errors import InputError


def stability(
    source: Annotated[
        Path,
        argument("npz of predict, FRFs (a file or a folder), a campaign, modes TOML.", "SOURCE"),
    ],
    cut: Annotated[Path, option("Cutter and cut.", "CUT_TOML")],
    pose: Annotated[str | None, option("Of the source's poses; all: each.", "NAME")] = None,
    path: Annotated[
        Path | None, option("Of a campaign: poses, or G-code or APT.", "CSV|PROGRAM")
    ] = None,
    origin: Annotated[
        str | None, option("Of a program: its zero in the robot's base, m.", "X,Y,Z")
    ] = None,
    turns: Annotated[
        bool, option("Along --path: turn the robot about the tool's axis.", None, "--turns")
    ] = False,
    map_: Annotated[bool, option("Of a campaign: all over the workspace.", None, "--map")] = False,
    poses: Annotated[
        int | None, option("Of a program (12), or of --map (40).", min=2, max=200)
    ] = None,
    tool: Annotated[Path | None, option("Put this tool on, as couple does.", "TOOL_TOML")] = None,
    reference: Annotated[
        Path | None, option("The tested tool, taken off before.", "TOOL_TOML")
    ] = None,
    robot: Annotated[
        Path | None, option("Tells how the tip turns; see couple.", "ROBOT_TOML")
    ] = None,
    noise: Annotated[float, option("With --tool: of FRFs without sd.", "PERCENT", min=0.0)] = 0.0,
    peak_force_n: Annotated[
        float | None,
        option(
            "Of a campaign: linearise joints that are not linear ([[law]]) for such hits.",
            "N",
            min=0.001,
        ),
    ] = None,
    point: Annotated[str | None, option("How stable is this very point?", "RPM,DEPTH_M")] = None,
    samples: Annotated[int, option("Of what is uncertain.", min=20, max=10000)] = 200,
    plot: Annotated[Path | None, option("Draw the lobes into this folder.", "FOLDER")] = None,
    format_: PictureFormat = "png",
    rrd: Rrd = None,
    from_names: FromNames = False,
    as_json: AsJson = False,
) -> int:
    """To which depth a cut is stable at each spindle speed, and how it chatters beyond.

    FRFs of a campaign are carried from the sensor to the tcp; those of a file are taken for the
    tip's, as they are.

    Example: planner stability cell7 --pose P001 --cut cut.toml --plot pictures
    """
    from planner.campaign.cut_source import StabilityRequest
    from planner.milling.cut import load_cut
    from planner.report.pictures import Pictures

    coupled, way = (tool, reference, robot, noise / 100), (path, origin, poses or 12, turns)
    asked = StabilityRequest(
        source, cut, pose, point, samples, *coupled, from_names, peak_force_n, *way
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
            from planner.report.stability import path_report

            return respond(path_report(asked, load_cut(cut), pictures, progress), as_json)
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
        argument(
            "FRFs at the tested tool's tip: npz, measured (a file or folder; from one with "
            "recordings.csv those of predict.csv are predicted), or a campaign.",
            "SOURCE",
        ),
    ],
    tool: Annotated[Path, option("The tool that is put on.", "TOOL_TOML")],
    out: Annotated[Path, option("Where its FRFs go.", "FILE.npz")],
    reference: Annotated[
        Path | None, option("The tested tool, which is taken off.", "TOOL_TOML")
    ] = None,
    pose: Annotated[str | None, option("Which pose of SOURCE.", "NAME")] = None,
    robot: Annotated[
        Path | None, option("Whose simulation tells how the tip turns.", "ROBOT_TOML")
    ] = None,
    noise: Annotated[float, option("Of FRFs whose file states no sd.", "PERCENT", min=0.0)] = 0.0,
    contact_from: Annotated[
        Path | None, option("Measured with TOOL there: its contact is identified.", "FRFS")
    ] = None,
    band_hz: Annotated[
        tuple[float, float] | None, option("Band in Hz, which has to be covered.", "LOW HIGH")
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
    contact = msgspec.UNSET
    if contact_from is not None:
        fitted = fitted_contact(tip, target, tested, contact_from, pose)
        target, contact = fitted.tool, fitted.to_json()
    both = coupling(tip, None), coupling(tip, target, tested)
    tools = None if tested is None else tested.name, target.name
    return respond(coupling_report(both, tools, name, out, contact, pictures), as_json)
