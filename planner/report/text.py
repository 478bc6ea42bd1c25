"""Parts of answers as text."""

import math
from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from planner.words import command, small

SIMULATED = Text(
    "SIMULATED RECORDINGS: nothing here was measured on a real robot", style="bold magenta"
)


def table(title: str | Text, *columns: str) -> Table:
    """A table whose first column is text and the others numbers."""
    made = Table(title=title, title_justify="left", header_style="bold")
    for i, column in enumerate(columns):
        made.add_column(column, justify="left" if i == 0 else "right", overflow="fold")
    return made


def number(value: float | None, form: str = ".2f") -> str:
    """A number, or a dash where there is none."""
    return format(value, form) if value is not None and math.isfinite(value) else "–"


def with_sd(value: float | None, sd: float | None, form: str = ".2f") -> str:
    """A number and its standard deviation, or a dash; an sd that rounds to 0 is below that digit.

    `form` has fixed decimals (".2f").
    """
    if number(value, form) == "–":
        return "–"
    known = small(sd, form) if sd is not None and math.isfinite(sd) else "–"
    return f"{number(value, form)} ± {known}"


def remarks(lines: Sequence[str]) -> list[Text]:
    """What the engineer should mind, one line each."""
    return [Text(f"  {line}", style="yellow") for line in lines]


def drawn(plots: Sequence[str], rrd: str | None = None) -> list[Text]:
    """Where pictures and a Rerun recording are, if there are any."""
    lines = [Text("\n  ".join(["Pictures:", *plots]))] if plots else []
    return [*lines, Text(f"Rerun recording: {rrd}")] if rrd else lines


def command_line(before: str, *words: object) -> Text:
    """A command to be copied: quoted as a shell needs it, and on one line however long it is."""
    return Text(f"{before}{command(*words)}", no_wrap=True, overflow="ignore")
