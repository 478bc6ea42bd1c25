"""What all pictures share: names of axes, colours, and how figures become files."""

import io
from pathlib import Path

from matplotlib import rc_context
from matplotlib.figure import Figure

AXES = ("x", "y", "z")
MEASURED, MODEL = "black", "tab:red"


def png(figure: Figure, dpi: int = 80) -> bytes:
    """The figure as PNG bytes, the same for the same figure."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
    return buffer.getvalue()


def save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG or SVG, by the file's name; the same file for the same figure."""
    # Without a salt the SVG's ids are random, without this entry it holds the time.
    stamp = {"Date": None} if path.suffix == ".svg" else {"Software": None}
    with rc_context({"svg.hashsalt": "planner"}):
        figure.savefig(path, dpi=150, metadata=stamp)
