"""How a command answers: one JSON document, or text for the engineer; and how far it is."""

import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread
from typing import TYPE_CHECKING, Annotated, Any

import typer

from planner.errors import RefusedFile
from planner.progress import ProgressCallback
from planner.words import by_reason

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from planner.report.answer import Answer

FIRST_S, LAST_S = 5.0, 60.0  # between lines of progress: at first, and at most, doubling
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
    Path | None, option("The robot's robot.toml (a campaign has its own).", "ROBOT_TOML")
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


@contextmanager
def progress_bar(verb: str, quiet: bool) -> Iterator[ProgressCallback]:
    """A function that shows on stderr what is being done, and the share (0 to 1) that is done.

    As a bar where somebody is looking, else in a line now and then.
    """
    from rich import progress as rich

    from planner.report.text import UnbrokenConsole

    text = rich.TextColumn("{task.description}", markup=False)
    bars = rich.SpinnerColumn(), rich.BarColumn(), rich.TaskProgressColumn()
    columns = *bars, rich.TimeElapsedColumn(), text
    screen = UnbrokenConsole(stderr=True, quiet=quiet)
    done, started = Event(), time.monotonic()
    hidden = not screen.is_terminal
    with rich.Progress(*columns, console=screen, transient=True, disable=hidden) as bar:
        task = bar.add_task(verb, total=None)

        def progress(text: str, share: float) -> None:
            if share > 0:  # until then nobody knows how long it takes
                bar.update(task, total=1.0)
            bar.update(task, description=f"{verb}: {text}", completed=share)

        # On a terminal it moves; elsewhere it is told in lines.
        teller = Thread(target=_tell, args=(bar, screen, done, started), daemon=True)
        if hidden and not quiet:
            teller.start()
        try:
            yield progress
        finally:
            done.set()
            if teller.is_alive():
                teller.join()


def _tell(bar: "Progress", screen: "Console", done: Event, started: float) -> None:
    wait = FIRST_S
    while not done.wait(wait):
        wait = min(2 * wait, LAST_S)
        for task in bar.tasks[-1:]:
            of = f", {100 * task.completed:.0f} %" if task.total else ""
            screen.print(f"{task.description}{of} ({time.monotonic() - started:.0f} s)")
