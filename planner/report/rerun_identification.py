"""An identification as a Rerun recording: FRFs pose by pose, and maps of all, before and after."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from matplotlib import colormaps

from planner.report.identification_plots import DirectFrfs, ShownPose
from planner.report.rerun_chart import (
    BRIGHT,
    GREY,
    GROUND,
    Chart,
    ChartAxis,
    Curve,
    chart_view,
    draw,
    log_range,
    write,
)
from planner.report.rerun_stream import open_stream

AXES = "xyz"
BEFORE, AFTER = (90, 170, 255), (255, 120, 100)
WIDE = 1.3
# Of a map: as many cells as are seen, its width or that of a pose's column at least, what a pose's
# name takes, and decades that colours span.
CELLS, MAP, COLUMN, NAME, DECADES = 240, 240, 12, 36, 3.0
KINDS = ("measured", "nominal", "identified")
GAP = 30  # between the maps of one direction


def record(poses: Sequence[ShownPose], shown: DirectFrfs, name: str, mark: str, rrd: Path) -> None:
    """Write the recording; InputError if it cannot be written."""
    stream = open_stream(f"identify|{name}", name, _blueprint(len(poses)), rrd)
    note = (
        f"# {name}\n{mark}White is measured, blue the nominal simulation, red the identified one. "
        "Poses follow each other on the timeline; those held out are shown with what was "
        "identified without them."
    )
    stream.log("note", rr.TextDocument(note, media_type="text/markdown"), static=True)
    for number, pose in enumerate(poses):
        stream.set_time("pose", sequence=number + 1)
        for i, axis in enumerate(AXES):
            draw(stream, f"frf/{axis}{axis}", _frf(pose, shown, number, i))
    stream.reset_time()
    for i, axis in enumerate(AXES):
        _maps(stream, f"map/{axis}{axis}", poses, shown, i)
    stream.flush(timeout_sec=10.0)
    stream.disconnect()


def _blueprint(count: int) -> rrb.Blueprint:
    frfs = [chart_view(f"frf/{a}{a}", f"H {a}{a}", WIDE) for a in AXES]
    maps = [_map_view(f"map/{a}{a}", f"Map of H {a}{a}", count) for a in AXES]
    about = rrb.TextDocumentView(origin="/note", name="What is what")
    tabs = rrb.Tabs(rrb.Horizontal(*frfs, name="FRFs, pose by pose"), *maps, about)
    return rrb.Blueprint(
        tabs, rrb.TimePanel(state="collapsed", timeline="pose"), collapse_panels=True
    )


def _frf(pose: ShownPose, shown: DirectFrfs, number: int, i: int) -> Chart:
    hz = shown.frequency_hz
    sizes = [one[number, i] for one in (shown.nominal, shown.identified, shown.measured)]
    styles = (("nominal", BEFORE, 1.0), ("identified", AFTER, 1.2), ("measured", BRIGHT, 0.8))
    curves = [
        Curve(name, hz, size, colour, thick=thick)
        for (name, colour, thick), size in zip(styles, sizes, strict=True)
    ]
    role = "held out" if pose.held_out else "used"
    return Chart(
        f"{pose.name}, {role}: H {AXES[i]}{AXES[i]}",
        ChartAxis(float(hz[0]), float(hz[-1]), "frequency (Hz)"),
        ChartAxis(*log_range(sizes), "m/s²/N", log=True), curves, wide=WIDE,
    )  # fmt: skip


def _maps(
    stream: rr.RecordingStream, path: str, poses: Sequence[ShownPose], shown: DirectFrfs, i: int
) -> None:
    """Measured, nominal and identified magnitudes over poses and frequency, side by side."""
    every = [one[:, i] for one in (shown.measured, shown.nominal, shown.identified)]
    low, high = log_range(every, DECADES)
    hz = np.linspace(shown.frequency_hz[0], shown.frequency_hz[-1], CELLS)
    column = _column(len(poses))
    named = range(0, len(poses), -(-NAME // column))
    words: list[tuple[str, tuple[float, float]]] = []
    parts: list[np.ndarray] = []
    for k, (kind, size) in enumerate(zip(KINDS, every, strict=True)):
        rows = np.array([np.interp(hz, shown.frequency_hz, row) for row in size])
        share = np.log(np.clip(rows, low, high) / low) / np.log(high / low)
        cells = (255 * colormaps["viridis"](np.nan_to_num(share))[..., :3]).astype(np.uint8)
        cells[~np.isfinite(rows)] = 0
        parts += [np.repeat(np.swapaxes(cells, 0, 1)[::-1], column, axis=1)]  # frequency upwards
        parts += [np.zeros((CELLS, GAP, 3), np.uint8)]
        left = k * (column * len(poses) + GAP)
        words.append((kind, (left + column * len(poses) / 2, -12)))
        words += [(poses[n].name, (left + column * (n + 0.5), CELLS + 2)) for n in named]
    stream.log(f"{path}/cells", rr.Image(np.concatenate(parts[:-1], axis=1)))
    words += [
        (f"{f:.0f} Hz", (-22, CELLS * (1 - share) - 4))
        for share, f in ((s, hz[0] + s * (hz[-1] - hz[0])) for s in (0.02, 0.25, 0.5, 0.75, 0.98))
    ]
    middle = (3 * column * len(poses) + 2 * GAP) / 2
    words.append((f"|H|: dark {low:.2g}, bright {high:.2g} m/s²/N", (middle, CELLS + 18)))
    write(stream, f"{path}/words", words, [GREY] * len(words))


def _column(count: int) -> int:
    """How wide the column of one of so many poses is."""
    return max(COLUMN, MAP // count)


def _map_view(path: str, name: str, count: int) -> rrb.Spatial2DView:
    wide = 3 * _column(count) * count + 2 * GAP
    bounds = rrb.VisualBounds2D(x_range=[-45, wide + 10], y_range=[-20, CELLS + 30])
    return rrb.Spatial2DView(origin=f"/{path}", name=name, background=GROUND, visual_bounds=bounds)
