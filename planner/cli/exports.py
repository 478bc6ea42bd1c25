"""What a campaign found, for others (`planner report`, `planner export`)."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import AsJson, respond

CampaignFolder = Annotated[Path, typer.Argument(metavar="DIR", help="Campaign folder.")]


def report(
    directory: CampaignFolder,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE.html", help="Where it goes (default: DIR/report.html)."),
    ] = None,
    diagnosis: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="What planner diagnose --out has written."),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Write all of a campaign into one HTML file: works offline, prints to PDF.

    Example: planner report cell7 --out cell7.html
    """
    from planner.campaign.campaign import Campaign
    from planner.cli.progress import telling
    from planner.report.page import write_report

    with telling("writing", quiet=as_json) as progress:
        progress("the report", 0.0)
        answer = write_report(Campaign(directory), out, diagnosis)
    return respond(answer, as_json)


def export(
    directory: CampaignFolder,
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND",
            help="Poses to drive to: krl, rapid, urscript, poses (CSV). Results: uff (58 and 55), "
            "mat, csv, model (one small file).",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Where it goes (default: DIR/export).")
    ] = None,
    poses: Annotated[
        Path | None,
        typer.Option(metavar="POSES_CSV", help="These poses instead of open or measured ones."),
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Write proposals for the robot's controller, or results for other programs.

    Axes, signs and offsets of the controller stand in robot.toml, [controller].

    Example: planner export cell7 krl --out usb
    """
    from planner.campaign.campaign import Campaign
    from planner.report.exports import export as write

    return respond(write(Campaign(directory), kind, out, poses), as_json)
