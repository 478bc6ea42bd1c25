"""What explains the rest (`planner schema`, `planner manual`)."""

from pathlib import Path
from typing import Annotated

import typer

from planner.cli.answer import AsJson, respond
from planner.report.answer import Done


def schema(
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="robot, campaign, cut or tool.")
    ] = "robot",
    as_json: AsJson = False,
) -> int:
    """Every entry of robot.toml, campaign.toml, cut.toml or tool.toml, as they are read.

    --json holds a JSON Schema, which editors complete and check by.

    Example: planner schema campaign
    """
    from planner.report.documentation import schema as entries

    return respond(entries(file), as_json)


def manual(
    context: typer.Context,
    out: Annotated[Path, typer.Option(metavar="FILE.html", help="Where the manual goes.")] = Path(
        "planner_manual.html"
    ),
    as_json: AsJson = False,
) -> int:
    """Write the manual as one HTML file: tutorial, files, commands, what numbers mean.

    Example: planner manual --out manual.html
    """
    from planner.report.documentation import write_manual

    assert context.parent is not None
    commands = getattr(context.parent.command, "commands", {})
    told = [(name, command.help or "") for name, command in commands.items()]
    file = write_manual(out, told)
    return respond(Done({"manual": str(file)}, f"The manual: {file}"), as_json)
