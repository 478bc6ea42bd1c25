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
    point: Annotated[
        str | None, typer.Option(metavar="RPM,DEPTH_M", help="How stable is this very point?")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """To which depth a cut is stable at each spindle speed, and how it chatters beyond."""
    from planner.report.stability_of import stability_of

    return respond(stability_of(source, cut, point), as_json)
