"""Where pictures go: files in a folder and a Rerun recording; figures as bytes of PNG or SVG."""

import io
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from planner.errors import InputError, writing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from planner.report.rerun.figures import More

SIMULATED_TITLE = "SIMULATED recordings"  # before the title of a picture


@dataclass(frozen=True)
class Pictures:
    """A folder for files of one format, and a Rerun file; None: not wanted."""

    folder: Path | None = None
    format: str = "png"
    rrd: Path | None = None

    def __post_init__(self) -> None:
        if self.format not in ("png", "svg"):
            raise InputError(f"--format {self.format} is not known; give png or svg.")

    @property
    def wanted(self) -> bool:
        return self.folder is not None or self.rrd is not None

    def write(
        self,
        draw: "Callable[[], dict[str, Figure]]",
        name: str,
        note: str = "",
        more: "More | None" = None,
        simulated: bool = False,
    ) -> dict[str, Any]:
        """Write every figure that `draw` gives, if wanted; the keys that say where they are.

        `name` says of what they are. In the Rerun file a `note` says what is what, and `more` draws
        what is no figure. Of `simulated` recordings titles and note say so. Raises InputError where
        they cannot be written.
        """
        if not self.wanted:
            return {"plots": (), "rrd": None}
        figures = draw()
        if simulated:
            note = f"{SIMULATED_TITLE} · {note}" if note else SIMULATED_TITLE
        for figure in figures.values():
            entitle(figure, name, simulated)
        files = []
        if self.folder is not None:
            if self.folder.exists() and not self.folder.is_dir():
                raise InputError(f"{self.folder} is a file; name a folder for the pictures.")
            with writing(self.folder, "another folder"):
                self.folder.mkdir(parents=True, exist_ok=True)
                for key, figure in figures.items():
                    files.append(self.folder.absolute() / f"{key}.{self.format}")
                    save(figure, files[-1])
        if self.rrd is not None:
            from planner.report.rerun.figures import record_figures

            record_figures(figures, name, note, self.rrd, more)
        return {
            "plots": tuple(str(file) for file in files),
            "rrd": None if self.rrd is None else str(self.rrd.absolute()),
        }


def entitle(figure: "Figure", name: str, simulated: bool) -> "Figure":
    """The figure; its title says what is simulated, and of what it is."""
    from planner.report.plot_marks import plain_text

    mark = f"{SIMULATED_TITLE} · " if simulated else ""
    figure.suptitle(f"{mark}{figure.get_suptitle()}\n{plain_text(name)}", fontsize=10)
    return figure


def png(figure: "Figure", dpi: int = 80) -> bytes:
    """The figure as PNG bytes, the same for the same figure."""
    return rendered(figure, format="png", dpi=dpi, metadata={"Software": None})


def save(figure: "Figure", path: Path) -> None:
    """Write a figure as PNG or SVG, by the file's name; the same file for the same figure."""
    from matplotlib import rc_context

    # Without a salt the SVG's ids are random, without this entry it holds the time.
    stamp = {"Date": None} if path.suffix == ".svg" else {"Software": None}
    with rc_context({"svg.hashsalt": "planner"}):
        path.write_bytes(rendered(figure, format=path.suffix[1:], dpi=150, metadata=stamp))


def rendered(figure: "Figure", **options: Any) -> bytes:
    """The figure as `Figure.savefig` writes it with these options.

    Characters that its fonts lack are drawn by others that the machine has; what no font has
    stays a box.
    """
    from matplotlib.text import Text

    image, missing = _drawn(figure, options)
    if not missing:
        return image
    others = _fonts_with(missing)
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        text.set_fontfamily([*text.get_fontfamily(), *others])
    return _drawn(figure, options)[0]


def _drawn(figure: "Figure", options: dict[str, Any]) -> tuple[bytes, set[int]]:
    """The picture, and the characters that its fonts lack."""
    buffer, missing = io.BytesIO(), set()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        figure.savefig(buffer, **options)
    for warning in told:
        found = re.match(r"Glyph (\d+) ", str(warning.message))
        if found:
            missing.add(int(found[1]))
        else:
            warnings.warn_explicit(
                warning.message, warning.category, warning.filename, warning.lineno
            )
    return buffer.getvalue(), missing


def _fonts_with(characters: set[int]) -> list[str]:
    """Fonts that have any of these characters (code points), those that have most of them first."""
    from matplotlib.font_manager import fontManager, get_font

    # "Last Resort" has a box for every character.
    fonts = [font for font in fontManager.ttflist if not font.name.startswith("Last Resort")]
    having = {f.name: len(characters & get_font(f.fname).get_charmap().keys()) for f in fonts}
    return sorted(filter(having.get, having), key=lambda name: -having[name])
