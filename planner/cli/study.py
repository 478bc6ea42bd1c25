"""The papers' studies again (`planner study`)."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from planner.cli.answer import AsJson, respond

if TYPE_CHECKING:
    from rich.console import RenderableType


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
    """Do a paper's study again on simulated recordings: tables, pictures, what holds."""
    from planner.cli.progress import counting
    from planner.studies import registry
    from planner.studies.report import check_folder, write

    made = registry.find(name)
    check_folder(out)
    start = time.perf_counter()
    with counting(quiet=as_json) as progress:
        report = made(progress)
    answer = {
        "study": report.study,
        "data": report.data,
        "tables": [
            {"name": t.name, "title": t.title, "columns": t.columns, "rows": t.rows}
            for t in report.tables
        ],
        "findings": [{"paper": f.paper, "here": f.here, "holds": f.holds} for f in report.findings],
        "files": write(report, out),
        "seconds": time.perf_counter() - start,
    }
    return respond(answer, as_json, _text)


def _text(answer: dict[str, Any]) -> "RenderableType":
    from rich.console import Group
    from rich.markup import escape

    from planner.cli.render import table

    parts: list[RenderableType] = [f"[bold magenta]{escape(answer['data'])}[/]"]
    for entry in answer["tables"]:
        made = table(entry["title"], *entry["columns"])
        for row in entry["rows"]:
            made.add_row(*(_cell(value) for value in row))
        parts.append(made)
    for finding in answer["findings"]:
        verdict = "[green]holds[/]" if finding["holds"] else "[red]does not hold[/]"
        parts.append(f"{verdict}: {escape(finding['paper'])}\n    {escape(finding['here'])}")
    if answer["files"]:
        parts.append(
            f"{len(answer['files'])} files in {escape(str(Path(answer['files'][0]).parent))}"
        )
    return Group(*parts)


def _cell(value: str | float) -> str:
    if isinstance(value, str):
        return value
    return "–" if value != value else f"{value:.4g}"
