"""Progress on stderr, where somebody is looking; nothing otherwise."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager


def console(quiet: bool, stderr: bool = True):
    """A rich console on stderr (or stdout), silent if `quiet`."""
    from rich.console import Console

    return Console(stderr=stderr, quiet=quiet)


@contextmanager
def reporting(verb: str, quiet: bool) -> Iterator[Callable[[str], None]]:
    """A function that shows what is being done, with the time it has taken so far."""
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    screen = console(quiet)
    with Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal) as bar:
        task = bar.add_task(verb, total=None)
        yield lambda text: bar.update(task, description=f"{verb}: {text}")


@contextmanager
def advancing(verb: str, quiet: bool) -> Iterator[Callable[[str, float], None]]:
    """A function that shows what is being done, and a bar with the share of all that is done."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (BarColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    screen = console(quiet)
    with Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal) as bar:
        task = bar.add_task(verb, total=1.0)
        yield lambda text, share: bar.update(task, description=f"{verb}: {text}", completed=share)
