"""Progress on stderr: bars where somebody is looking, else a line now and then."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, ProgressColumn

FIRST_S, LAST_S = 5.0, 60.0  # between lines: the first one, and at most, doubling in between


def console(quiet: bool, stderr: bool = True):
    """A rich console on stderr (or stdout), silent if `quiet`."""
    from planner.report.console import UnbrokenConsole

    return UnbrokenConsole(stderr=stderr, quiet=quiet)


@contextmanager
def reporting(verb: str, quiet: bool) -> Iterator[Callable[[str], None]]:
    """A function that shows what is being done, with the time it has taken so far."""
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
    with _shown(columns, quiet) as bar:
        task = bar.add_task(verb, total=None)
        yield lambda text: bar.update(task, description=f"{verb}: {text}")


@contextmanager
def bars(quiet: bool) -> Iterator[Callable[[str, int, int], None]]:
    """A function (what, done, of how many) that moves a bar for each thing that is counted."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn())
    times = (TimeElapsedColumn(), TimeRemainingColumn())
    shown: dict[str, Any] = {}
    with _shown((*columns, *times), quiet) as progress:

        def tell(what: str, done: int, total: int) -> None:
            if what not in shown:
                shown[what] = progress.add_task(what, total=total)
            progress.update(shown[what], completed=done)

        yield tell


@contextmanager
def counting(quiet: bool) -> Iterator[Callable[[str, float], None]]:
    """A function that shows what is being done and which share (0 to 1) is, as a bar."""
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn

    columns = (BarColumn(), TaskProgressColumn(), TimeElapsedColumn(),
               TextColumn("{task.description}", markup=False))  # fmt: skip
    with _shown(columns, quiet) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda text, share: bar.update(task, description=text, completed=share)


@contextmanager
def _shown(columns: "tuple[ProgressColumn, ...]", quiet: bool) -> "Iterator[Progress]":
    """Progress that moves on a terminal; elsewhere its last task is told in lines."""
    from rich.progress import Progress

    screen = console(quiet)
    done, started = Event(), time.monotonic()
    with Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal) as bar:
        teller = Thread(target=_tell, args=(bar, screen, done, started), daemon=True)
        if not (quiet or screen.is_terminal):
            teller.start()
        try:
            yield bar
        finally:
            done.set()
            if teller.is_alive():
                teller.join()


def _tell(bar: "Progress", screen: "Console", done: Event, started: float) -> None:
    wait = FIRST_S
    while not done.wait(wait):
        wait = min(2 * wait, LAST_S)
        for task in bar.tasks[-1:]:
            of = f", {task.completed:g} of {task.total:g}" if (task.total or 0) > 1 else ""
            of = f", {100 * task.completed:.0f} %" if task.total == 1 else of
            screen.print(f"{task.description}{of} ({time.monotonic() - started:.0f} s)")
