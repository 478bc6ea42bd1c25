"""The papers' studies again (`planner study`)."""

import time
from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import AsJson, respond


def study(
    name: Annotated[
        str,
        typer.Argument(metavar="NAME", help="busch2022, busch2020, seyedhosseini2025 or lei2023."),
    ],
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Write tables (CSV) and pictures here.")
    ] = None,
    as_json: AsJson = False,
) -> int:
    """Do a paper's study again on simulated recordings: tables, pictures, what holds.

    Example: planner study busch2022 --out figures
    """
    from planner.cli.progress import counting
    from planner.studies import registry
    from planner.studies.answer import StudyAnswer
    from planner.studies.report import check_folder, write

    made = registry.find(name)
    check_folder(out)
    start = time.perf_counter()
    with counting(quiet=as_json) as progress:
        report = made(progress)
    files = write(report, out)
    return respond(StudyAnswer.of(report, files, time.perf_counter() - start), as_json)
