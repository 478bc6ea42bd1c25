"""Parts of answers as text, and the console for it: numbers stay with what goes with them."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from planner.words import command, significant, small

# No-break spaces, and those about ±, before a unit, and between a mode and what it has. Rich breaks
# lines at no-break spaces, too: it is given a character that nobody uses in their place, and what
# it made of that is put right again.
UNIT = r"(?:%|°|sd|dB|Hz|kHz|mm|µm|min|rpm|kg|ms|m/s²|N·m/rad|N/m|[mNs])(?![\w/·])"
NUMBERED = r"\u00a0|(?<=\bmode) (?=\d)|(?<=\bmode \d) (?=\d)"
TOGETHER = re.compile(rf"(?<=\S) (?=± ?[<\d])|(?<= ±) (?=[<\d])|(?<=\d) (?={UNIT})|{NUMBERED}")
STAND_IN = "\ue000"
SIMULATED = Text(
    "SIMULATED RECORDINGS: nothing here was measured on a real robot", style="bold magenta"
)


def table(
    title: str | Text, *columns: str, rows: Iterable[Iterable[str | Text]] = (), words: bool = False
) -> Table:
    """A table whose first column is text and the others numbers, or `words` too."""
    made = Table(title=title, title_justify="left", header_style="bold")
    for i, column in enumerate(columns):
        made.add_column(column, justify="right" if i and not words else "left", overflow="fold")
    for row in rows:
        made.add_row(*row)
    return made


def plain_table(*columns: str) -> Table:
    """The same without title and lines, as the session has room for."""
    made = Table(box=None, header_style="bold", pad_edge=False)
    for i, column in enumerate(columns):
        made.add_column(column, justify="right" if i else "left")
    return made


def number(value: float | None, form: str = ".2f") -> str:
    """A number, or a dash where there is none."""
    return format(value, form) if value is not None and math.isfinite(value) else "–"


def sds_over_workspace(sd_percent: Iterable[float], target_percent: float) -> str:
    """How sure the frequency of each mode is over the workspace, and how sure all are to be."""
    each = ", ".join(f"mode {k} {significant(sd)} %" for k, sd in enumerate(sd_percent, 1))
    target = f"target {target_percent:g} % rms of all"
    return f"sd of predicted frequencies over the workspace: {each} ({target})"


def with_sd(value: float | None, sd: float | None, form: str = ".2f") -> str:
    """A number and its standard deviation, or a dash; an sd that rounds to 0 is below that digit.

    `form` has fixed decimals (".2f"); of a larger sd two digits are enough.
    """
    if number(value, form) == "–":
        return "–"
    if sd and math.isfinite(sd):
        form = f".{max(0, min(int(form[1:-1]), 1 - math.floor(math.log10(sd))))}f"
    known = small(sd, form) if sd is not None and math.isfinite(sd) else "–"
    return f"{number(value, form)} ± {known}"


def remarks(lines: Sequence[str]) -> list[Text]:
    """What the engineer should mind, one line each."""
    return [Text(f"  {line}", style="yellow") for line in lines]


def ending(made: Mapping[str, Any]) -> list[Text]:
    """The last lines of an answer of such keys: where pictures are, what is simulated."""
    plots, rrd = made.get("plots"), made.get("rrd")
    lines = [Text("\n  ".join(["Pictures:", *plots]))] if plots else []
    lines += [Text(f"Rerun recording: {rrd}")] if rrd else []
    return [*lines, *([SIMULATED] if made.get("simulated") else [])]


def command_line(before: str, *words: object) -> Text:
    """A command to be copied: quoted as a shell needs it, and on one line however long it is."""
    return Text(f"{before}{command(*words)}", no_wrap=True, overflow="ignore")


class UnbrokenConsole(Console):
    """A console on which "2.3 ± 0.1 Hz" stays on one line, if the line is long enough for it."""

    def __init__(self, **options):
        super().__init__(markup=False, emoji=False, **options)  # names of poses are no markup

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Of texts, also those within tables and panels."""
        width = (options or self.options).max_width
        kept = TOGETHER.sub(STAND_IN, renderable.plain) if isinstance(renderable, Text) else ""
        if STAND_IN not in kept or max(map(len, kept.split())) > width:
            yield from super().render(renderable, options)
            return
        assert isinstance(renderable, Text)
        text = renderable.copy()
        text.plain = kept
        for made in super().render(text, options):
            yield Segment(made.text.replace(STAND_IN, " "), made.style, made.control)
