"""What a campaign found, for others (`planner report`)."""

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
    from planner.cli.progress import reporting
    from planner.report.campaign_report import write_report

    with reporting("writing", quiet=as_json) as progress:
        progress("the report")
        answer = write_report(Campaign(directory), out, diagnosis)
    return respond(answer, as_json)
