"""FRFs of another tool by receptance coupling (`planner couple`)."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import AsJson, FromNames, respond


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
    plot: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Draw the FRFs into this folder.")
    ] = None,
    format_: Annotated[str, typer.Option("--format", help="Of the picture: png or svg.")] = "png",
    rrd: Annotated[Path | None, typer.Option(help="Write a Rerun recording to this file.")] = None,
    from_names: FromNames = False,
    as_json: AsJson = False,
) -> int:
    """Predict the FRFs of another tool: the tested one is taken off, the other put on.

    Example: planner couple predictions/poses.npz --tool long.toml --out long.npz
    """
    from planner.campaign.tip_source import fitted_contact, tip_of, within
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
