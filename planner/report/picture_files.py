"""Figures as bytes of PNG or SVG, with fonts for whatever characters users put into names."""

import io
import re
import warnings
from collections.abc import Iterable
from typing import Any

from matplotlib.figure import Figure
from matplotlib.text import Text

MISSING = re.compile(r"Glyph (\d+) ")
LAST_RESORT = "Last Resort"  # has a box for every character


def rendered(figure: Figure, **options: Any) -> bytes:
    """The figure as `Figure.savefig` writes it with these options.

    Characters that its fonts lack are drawn by others that the machine has; what no font has
    stays a box.
    """
    image, missing = _drawn(figure, options)
    others = _fonts_with(missing)
    if not others:
        return image
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        text.set_fontfamily([*text.get_fontfamily(), *others])
    return _drawn(figure, options)[0]


def _drawn(figure: Figure, options: dict[str, Any]) -> tuple[bytes, set[int]]:
    """The picture, and the characters that its fonts lack."""
    buffer, missing = io.BytesIO(), set()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        figure.savefig(buffer, **options)
    for warning in told:
        found = MISSING.match(str(warning.message))
        if found:
            missing.add(int(found[1]))
        else:
            warnings.warn_explicit(
                warning.message, warning.category, warning.filename, warning.lineno
            )
    return buffer.getvalue(), missing


def _fonts_with(characters: Iterable[int]) -> list[str]:
    """Fonts that have characters (code points), those that have most of them first."""
    from matplotlib.font_manager import fontManager, get_font

    left, found = set(characters), []
    if not left:
        return found
    fonts = [font for font in fontManager.ttflist if not font.name.startswith(LAST_RESORT)]
    having = {font.name: left & get_font(font.fname).get_charmap().keys() for font in fonts}
    while left:
        best = max(having, key=lambda name: len(having[name] & left))
        if not having[best] & left:
            break
        found.append(best)
        left -= having[best]
    return found
