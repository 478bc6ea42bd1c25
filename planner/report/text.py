"""Parts of answers as text."""

from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from planner.words import small

SIMULATED = Text(
    "SIMULATED RECORDINGS: nothing here was measured on a real robot", style="bold magenta"
)
SIMULATED_TITLE = "SIMULATED recordings · "  # before the title of a picture


def table(title: str, *columns: str) -> Table:
    """A table whose first column is text and the others numbers."""
    made = Table(title=title, title_justify="left", header_style="bold")
    for i, column in enumerate(columns):
        made.add_column(column, justify="left" if i == 0 else "right", overflow="fold")
    return made


def number(value: float | None, form: str = ".2f") -> str:
    """A number, or a dash where there is none."""
    return "–" if value is None or value != value else format(value, form)


def with_sd(value: float | None, sd: float | None, form: str = ".2f") -> str:
    """A number and its standard deviation, or a dash; an sd that rounds to 0 is below that digit.

    `form` has fixed decimals (".2f").
    """
    if number(value, form) == "–":
        return "–"
    return f"{number(value, form)} ± {number(sd, form) if not sd or sd != sd else small(sd, form)}"


def command(text: str) -> Text:
    """A command to be pasted: on a line of its own that is never broken."""
    return Text(text, no_wrap=True, overflow="ignore")


def remarks(lines: Sequence[str]) -> list[Text]:
    """What the engineer should mind, one line each."""
    return [Text(f"  {line}", style="yellow") for line in lines]


def drawn(plots: Sequence[str], rrd: str | None = None) -> list[Text]:
    """Where pictures and a Rerun recording are, if there are any."""
    lines = [Text("\n  ".join(["Pictures:", *plots]))] if plots else []
    return [*lines, Text(f"Rerun recording: {rrd}")] if rrd else lines
