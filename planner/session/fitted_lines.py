"""Lines of a page that is never higher than the screen: what matters most is said in full."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rich.text import Text

from planner.report.console import UnbrokenConsole

_RULER = UnbrokenConsole(width=80)  # only to ask how text wraps


@dataclass(frozen=True, eq=False)
class Said:
    """One thing that is said: from its shortest form to its longest, of None nothing is seen.

    All are said at one length before any is at the next, those of the lowest `rank` first.
    """

    forms: Sequence[Text | None]
    rank: int = 0


def fitted(parts: Iterable[Said], width: int, height: int) -> list[Text]:
    """The longest forms, in order, that `height` lines of `width` columns hold together.

    The shortest ones are taken in any case.
    """
    parts = list(parts)
    chosen = [0] * len(parts)
    lines = [[_height(form, width) for form in part.forms] for part in parts]
    room = height - sum(own[0] for own in lines)
    order = sorted(range(len(parts)), key=lambda i: parts[i].rank)
    for k in range(1, max((len(own) for own in lines), default=0)):
        for i in (i for i in order if k < len(lines[i])):
            more = lines[i][k] - lines[i][chosen[i]]
            if more <= room:
                chosen[i], room = k, room - more
    found = (part.forms[k] for part, k in zip(parts, chosen, strict=True))
    return [form for form in found if form is not None]


def _height(form: Text | None, width: int) -> int:
    options = _RULER.options.update(width=width)
    return 0 if form is None else len(_RULER.render_lines(form, options))
