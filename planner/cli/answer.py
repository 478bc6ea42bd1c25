"""How a command answers: one JSON document, or text for the engineer."""

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from planner.errors import RefusedFile
from planner.words import by_reason

if TYPE_CHECKING:
    from planner.report.answer import Answer

RECORDED = "Folder with recordings.csv, or with folders that have one; or a campaign"


def argument(text: str, metavar: str | None = None) -> Any:
    """An argument with its help text."""
    return typer.Argument(metavar=metavar, help=text)


def option(text: str, metavar: str | None = None, *names: str, **limits: Any) -> Any:
    """An option with its help text, called by its parameter's name unless `names` are given."""
    return typer.Option(*names, metavar=metavar, help=text, **limits)


AsJson = Annotated[bool, option("Answer with one JSON document.", None, "--json")]
Directory = Annotated[Path, argument("Campaign folder.", "DIR")]
RobotOption = Annotated[
    Path | None, option("The robot's robot.toml (a campaign has its own).", "ROBOT_TOML", "--robot")
]
FromNames = Annotated[
    bool,
    option(
        "FRFs' directions or nodes from file names (tap_yx, H3_1) where files lack them.",
        None,
        "--from-names",
    ),
]
WindowRate = Annotated[
    float, option("Of the analyser's exponential window.", "1/S", "--window-rate")
]
PictureFormat = Annotated[str, option("Of the pictures: png or svg.", None, "--format")]
Rrd = Annotated[Path | None, option("Write a Rerun recording to this file.")]


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


def refusals(files: Iterable[RefusedFile], questions: Iterable[str] = ()) -> int:
    """Say on stderr what was refused, and what is asked; the exit code that goes with it."""
    refused, asked = list(files), list(questions)
    # What is held is said once, with the question, not hit by hit.
    told = [f for f in refused if not any(question.startswith(f.reason) for question in asked)]
    for one in by_reason((f.file, f.reason) for f in told):
        warn(f"Refused {one}")
    for question in asked:
        warn(question)
    return 3 if refused or asked else 0
