"""The papers' studies again (`planner study`)."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import AsJson, respond


def study(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME|all",
            help="busch2022, busch2020, seyedhosseini2025, lei2023, birk2025, or all.",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Write tables (CSV), pictures and pages (HTML) here."),
    ] = None,
    small: Annotated[
        bool,
        typer.Option("--small", help="A version of seconds, to see that it works: says little."),
    ] = False,
    as_json: AsJson = False,
) -> int:
    """Do a paper's study again on simulated recordings: tables, pictures, what holds.

    `all` keeps each finished study in FOLDER and does not run it again.

    Example: planner study busch2022 --out figures
    """
    from planner.cli.progress import counting
    from planner.studies import registry
    from planner.studies.conduct import conduct, conduct_all

    with counting(quiet=as_json) as progress:
        if name == registry.ALL:
            answer = conduct_all(out, small, progress)
        else:
            answer = conduct(name, out, small, progress)
    return respond(answer, as_json)
