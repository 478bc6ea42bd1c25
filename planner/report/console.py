"""The console that texts are printed on: no line ends between a number and what goes with it."""

import re
from collections.abc import Iterable

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.text import Text

# No-break spaces, and those about ±, before a unit, and between a mode and what it has. Rich breaks
# lines at no-break spaces, too: it is given a character that nobody uses in their place, and what
# it made of that is put right again.
UNIT = r"(?:%|°|sd|dB|Hz|kHz|mm|µm|min|rpm|kg|ms|m/s²|N·m/rad|N/m|[mNs])(?![\w/·])"
NUMBERED = r"\u00a0|(?<=\bmode) (?=\d)|(?<=\bmode \d) (?=\d)"
TOGETHER = re.compile(rf"(?<=\S) (?=± ?[<\d])|(?<= ±) (?=[<\d])|(?<=\d) (?={UNIT})|{NUMBERED}")
STAND_IN = "\ue000"


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
