"""Progress on stderr, where somebody is looking; nothing otherwise."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


def console(quiet: bool, stderr: bool = True):
    """A rich console on stderr (or stdout), silent if `quiet`."""
    from planner.report.console import UnbrokenConsole

    return UnbrokenConsole(stderr=stderr, quiet=quiet)


@contextmanager
def reporting(verb: str, quiet: bool) -> Iterator[Callable[[str], None]]:
    """A function that shows what is being done, with the time it has taken so far."""
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
    screen = console(quiet)
    with Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal) as bar:
        task = bar.add_task(verb, total=None)
        yield lambda text: bar.update(task, description=f"{verb}: {text}")


@contextmanager
def bars(quiet: bool) -> Iterator[Callable[[str, int, int], None]]:
    """A function (what, done, of how many) that moves a bar for each thing that is counted."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn())
    times = (TimeElapsedColumn(), TimeRemainingColumn())
    screen = console(quiet)
    shown: dict[str, Any] = {}
    with Progress(
        *columns, *times, console=screen, transient=True, disable=not screen.is_terminal
    ) as progress:

        def tell(what: str, done: int, total: int) -> None:
            if what not in shown:
                shown[what] = progress.add_task(what, total=total)
            progress.update(shown[what], completed=done)

        yield tell


@contextmanager
def counting(quiet: bool) -> Iterator[Callable[[str, float], None]]:
    """A function that shows what is being done and which share (0 to 1) is, as a bar."""
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    columns = (BarColumn(), TaskProgressColumn(), TimeElapsedColumn(),
               TextColumn("{task.description}", markup=False))  # fmt: skip
    screen = console(quiet)
    with Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda text, share: bar.update(task, description=text, completed=share)
