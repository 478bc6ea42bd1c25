"""What all pictures share: names of axes, colours, and how figures become files."""

from pathlib import Path

from matplotlib import rc_context
from matplotlib.figure import Figure

from planner.report.picture_files import rendered

AXES = ("x", "y", "z")
MEASURED, MODEL = "black", "tab:red"


def png(figure: Figure, dpi: int = 80) -> bytes:
    """The figure as PNG bytes, the same for the same figure."""
    return rendered(figure, format="png", dpi=dpi, metadata={"Software": None})


def save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG or SVG, by the file's name; the same file for the same figure."""
    # Without a salt the SVG's ids are random, without this entry it holds the time.
    stamp = {"Date": None} if path.suffix == ".svg" else {"Software": None}
    with rc_context({"svg.hashsalt": "planner"}):
        path.write_bytes(rendered(figure, format=path.suffix[1:], dpi=150, metadata=stamp))
