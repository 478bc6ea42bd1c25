"""Progress on stderr: bars where somebody is looking, else a line now and then."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import TYPE_CHECKING

from planner.progress import ProgressCallback

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

FIRST_S, LAST_S = 5.0, 60.0  # between lines: the first one, and at most, doubling in between


@contextmanager
def progress_bar(verb: str, quiet: bool) -> Iterator[ProgressCallback]:
    """A function that shows what is being done, and as a bar the share (0 to 1) that is done."""
    from rich.progress import (
        BarColumn,
        Progress,
        SpinnerColumn,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
    )

    from planner.report.text import UnbrokenConsole

    columns = (SpinnerColumn(), BarColumn(), TaskProgressColumn(), TimeElapsedColumn(),
               TextColumn("{task.description}", markup=False))  # fmt: skip
    screen = UnbrokenConsole(stderr=True, quiet=quiet)
    done, started = Event(), time.monotonic()
    with Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal) as bar:
        task = bar.add_task(verb, total=None)

        def progress(text: str, share: float) -> None:
            if share > 0:  # until then nobody knows how long it takes
                bar.update(task, total=1.0)
            bar.update(task, description=f"{verb}: {text}", completed=share)

        # On a terminal it moves; elsewhere it is told in lines.
        teller = Thread(target=_tell, args=(bar, screen, done, started), daemon=True)
        if not (quiet or screen.is_terminal):
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
