"""How a command answers: one JSON document, or text for the engineer."""

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.words import by_reason

if TYPE_CHECKING:
    from planner.report.answer import Answer, RefusedFile

AsJson = Annotated[bool, typer.Option("--json", help="Answer with one JSON document.")]

RECORDED = "Folder with recordings.csv, or with folders that have one; or a campaign"

RobotOption = Annotated[
    Path | None,
    typer.Option(
        "--robot", metavar="ROBOT_TOML", help="The robot's robot.toml (a campaign has its own)."
    ),
]

FromNames = Annotated[
    bool,
    typer.Option(
        "--from-names",
        help="FRFs' directions or nodes from file names (tap_yx, H3_1) where files lack them.",
    ),
]


def respond(answer: "Answer", as_json: bool, code: int = 0) -> int:
    """Print the answer and return the exit code."""
    if as_json:
        from planner.report.answer import encoded

        sys.stdout.write(encoded(answer).decode() + "\n")
        sys.stdout.flush()
    else:
        from planner.report.text import UnbrokenConsole

        text = answer.text()
        if text is not None:
            UnbrokenConsole().print(text, crop=False)  # commands to be copied are on one line
    return code


def warn(sentence: str) -> None:
    """One sentence on stderr."""
    print(" ".join(sentence.split()), file=sys.stderr)


def refusals(files: "Iterable[RefusedFile]", questions: Iterable[str] = ()) -> int:
    """Say on stderr what was refused, and what is asked; the exit code that goes with it."""
    refused, asked = list(files), list(questions)
    # What is held is said once, with the question, not hit by hit.
    told = [f for f in refused if not any(question.startswith(f.reason) for question in asked)]
    for one in by_reason((f.file, f.reason) for f in told):
        warn(f"Refused {one}")
    for question in asked:
        warn(question)
    return 3 if refused or asked else 0
