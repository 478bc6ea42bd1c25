"""Rerun recordings, and Matplotlib figures in them: the plots of files and pages as they are there.

Rerun's plots run over its timelines and linearly; frequency responses need neither. So a figure is
a view in two dimensions: its frame and text an image, its lines strips that stay sharp however
near one looks, and that hide one by one.
"""

import hashlib
import re
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.path import Path as Path2D

from planner.errors import writing
from planner.report.pictures import png

PORT = 9876
DPI = 160
More = Callable[[rr.RecordingStream], tuple[rrb.View | rrb.Container, rrb.TimePanel]]


def open_stream(
    identity: str, name: str, blueprint: rrb.Blueprint, rrd: Path | None, viewer: bool = False
) -> rr.RecordingStream:
    """A recording that `identity` and content alone determine; InputError if it cannot be."""
    key = hashlib.sha256(identity.encode()).hexdigest()[:32]
    stream = rr.RecordingStream("planner", recording_id=key, send_properties=False)
    # The clock would make two recordings of one campaign differ.
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    sinks: list[rr.FileSink | rr.GrpcSink] = []
    if rrd is not None:
        with writing(rrd):
            rrd.parent.mkdir(parents=True, exist_ok=True)
            rrd.write_bytes(b"")
        sinks.append(rr.FileSink(str(rrd)))
    if viewer and _start_viewer():
        sinks.append(rr.GrpcSink(f"rerun+http://127.0.0.1:{PORT}/proxy"))
    stream.set_sinks(*sinks, default_blueprint=blueprint)
    stream.send_recording_name(name)
    return stream


def _start_viewer() -> bool:
    """Open the viewer unless one listens already; False, with a word, if there can be none."""
    if _listens():
        return True
    # The viewer listens on every network interface unless told otherwise.
    process = subprocess.Popen(
        [sys.executable, "-m", "rerun", "--bind", "127.0.0.1", "--port", str(PORT)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    until = time.monotonic() + 15.0
    while time.monotonic() < until and process.poll() is None:
        if _listens():
            # Without a display it listens first and ends then.
            time.sleep(0.5)
            if process.poll() is None:
                return True
        time.sleep(0.1)
    if process.poll() is None:
        process.kill()
    print("The Rerun viewer did not open here; going on without it.", file=sys.stderr)
    return False


def _listens() -> bool:
    with socket.socket() as probe:
        probe.settimeout(0.2)
        return probe.connect_ex(("127.0.0.1", PORT)) == 0


def figure_view(path: str, name: str) -> rrb.Spatial2DView:
    """The view of the figure that is drawn at a path, in black whatever the viewer's theme is."""
    return rrb.Spatial2DView(origin=f"/{path}", name=name, background=(255, 255, 255))


def draw(stream: rr.RecordingStream, path: str, figure: Figure, static: bool = False) -> None:
    """Log a figure at a path, at the recording's current time, or for all times."""
    if not static:  # what was drawn there before may have had other lines
        stream.log(path, rr.Clear(recursive=True))
    sharp = _solid_lines(figure)
    for _, line in sharp.values():
        line.set_linestyle("None")
    frame = rr.EncodedImage(contents=png(figure, DPI), media_type="image/png", draw_order=0.0)
    stream.log(f"{path}/frame", frame, static=static)
    for name, (panel, line) in sharp.items():
        line.set_linestyle("-")
        alpha = line.get_alpha()
        rgba = to_rgba(line.get_color(), 1.0 if alpha is None else alpha)
        strips = rr.LineStrips2D(
            _strips(figure, panel, line), colors=[round(255 * part) for part in rgba],
            draw_order=1.0 + line.zorder, radii=rr.Radius.ui_points(0.5 * line.get_linewidth()),
        )  # fmt: skip
        stream.log(f"{path}/{name}", strips, static=static)


def record_figures(
    figures: Mapping[str, Figure], name: str, note: str, rrd: Path, more: More | None = None
) -> None:
    """A tab for each figure by its name, then what `more` draws; InputError if that cannot be."""
    tabs: list[rrb.View | rrb.Container] = []
    time = rrb.TimePanel(state="hidden")
    # The blueprint comes last: only then it is known what there is to be seen.
    stream = open_stream(f"{' '.join(figures)}|{name}", name, rrb.Blueprint(), rrd)
    for key, figure in figures.items():
        draw(stream, f"figures/{key}", figure, static=True)
        tabs.append(figure_view(f"figures/{key}", key.replace("_", " ")))
    if more is not None:
        view, time = more(stream)
        tabs.append(view)
    if note:
        text = rr.TextDocument(f"# {name}\n{note}", media_type="text/markdown")
        stream.log("note", text, static=True)
        tabs.append(rrb.TextDocumentView(origin="/note", name="What is what"))
    stream.send_blueprint(rrb.Blueprint(rrb.Tabs(*tabs), time, collapse_panels=True))
    stream.flush(timeout_sec=10.0)
    stream.disconnect()


def one_by_one(timeline: str, name: str, figures: Iterable[Figure]) -> More:
    """Draws figures one after the other along a timeline, counted from 1."""

    def drawn(stream: rr.RecordingStream) -> tuple[rrb.View, rrb.TimePanel]:
        for number, figure in enumerate(figures, 1):
            stream.set_time(timeline, sequence=number)
            draw(stream, timeline, figure)
        stream.reset_time()
        return figure_view(timeline, name), rrb.TimePanel(state="collapsed", timeline=timeline)

    return drawn


def _solid_lines(figure: Figure) -> dict[str, tuple[Axes, Line2D]]:
    """Lines of plots of two dimensions by panel and label; dashes and marks stay in the image."""
    found: dict[str, tuple[Axes, Line2D]] = {}
    for number, panel in enumerate(figure.axes):
        for k, line in enumerate(panel.lines if panel.name != "3d" else ()):
            label = str(line.get_label())
            named = "" if label.startswith("_") else re.sub(r"\W", "_", label)
            name = f"{number}/{named or f'line_{k}'}"
            if line.get_visible() and line.get_linestyle() == "-":
                found[f"{name}_{k}" if name in found else name] = panel, line
    return found


def _strips(figure: Figure, panel: Axes, line: Line2D) -> list[np.ndarray]:
    """Each part (n, 2) of a line in pixels of the image, cut off at the panel's frame."""
    low, high = panel.bbox.get_points()
    path = line.get_transform().transform_path(line.get_path())
    inside = path.cleaned(remove_nans=True, clip=(*low, *high), simplify=False)
    codes, vertices = np.asarray(inside.codes), np.asarray(inside.vertices)
    drawn = codes != Path2D.STOP
    starts = np.flatnonzero(codes[drawn] == Path2D.MOVETO)
    x, y = vertices[drawn].T
    places = np.stack([x, figure.bbox.height - y], axis=1) * DPI / figure.dpi
    return [part for part in np.split(places, starts) if len(part) > 1]
