"""Learning curves as a Rerun recording: a chart a quantity, a curve a strategy."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from planner.report.learning_curves import Band, Learning
from planner.report.rerun_chart import (
    GREY,
    Chart,
    ChartAxis,
    ChartBand,
    Colour,
    Curve,
    chart_view,
    draw,
    log_range,
)
from planner.report.rerun_curves import mode_colour as colour_of
from planner.report.rerun_stream import open_stream

TITLES = {
    "rmse_percent": "Frequency RMSE at unused poses",
    "r2": "R²",
    "coverage95": "Share in 95 % intervals",
}
WANTED = {"rmse_percent": 1.0, "coverage95": 0.95}  # what is drawn as a line beside the curves
WIDE, TALL = 2.6, 1.5  # of the frames: how often as wide as high


def write(
    strategies: Mapping[str, Learning], rrd: Path, identity: str, name: str, note: str
) -> None:
    """Medians over repeats, with quartiles of the RMSE; InputError if it cannot be written."""
    first, *others = (chart_view(key, title, _wide(key)) for key, title in TITLES.items())
    curves = rrb.Horizontal(first, rrb.Vertical(*others), column_shares=[3, 2], name="Curves")
    about = rrb.TextDocumentView(origin="/note", name="What is what")
    layout = rrb.Blueprint(
        rrb.Tabs(curves, about), rrb.TimePanel(state="hidden"), collapse_panels=True
    )
    stream = open_stream(f"compare|{identity}", name, layout, rrd)
    text = f"# {name}\n{note}\n\nMedians over runs; strokes of the RMSE: quartiles."
    stream.log("note", rr.TextDocument(text, media_type="text/markdown"), static=True)
    for key, title in TITLES.items():
        draw(stream, key, _chart(key, title, strategies))
    stream.flush(timeout_sec=10.0)
    stream.disconnect()


def _chart(key: str, title: str, strategies: Mapping[str, Learning]) -> Chart:
    bands: dict[str, Band] = {name: getattr(one, key) for name, one in strategies.items()}
    last = max(float(one.n[-1]) for one in strategies.values())
    x = ChartAxis(0.0, last + 0.5, "measurements")
    curves, spread = [], []
    for k, (name, one) in enumerate(strategies.items()):
        n, median = one.n.astype(float), bands[name].median
        curves += [
            Curve(name, n, median, colour_of(k)),
            Curve("", n, median, colour_of(k), dots=True, thick=0.8),
        ]
        if key == "rmse_percent":
            aside = n + 0.08 * (k - (len(strategies) - 1) / 2)  # so that strokes stand apart
            dim = _dimmed(colour_of(k))
            spread.append(ChartBand("", aside, bands[name].low, bands[name].high, dim, 0.05))
    if key in WANTED:
        level = np.full(2, WANTED[key])
        curves.append(Curve(f"{WANTED[key]:g}", np.array([0.0, last + 0.5]), level, GREY))
    return Chart(title, x, _axis(key, bands), curves, spread, _wide(key))


def _wide(key: str) -> float:
    return TALL if key == "rmse_percent" else WIDE


def _axis(key: str, bands: Mapping[str, Band]) -> ChartAxis:
    if key == "rmse_percent":
        ends = [end for band in bands.values() for end in (band.low, band.high)]
        return ChartAxis(*log_range([*ends, np.ones(1)]), "RMSE (%)", log=True)
    if key == "coverage95":
        return ChartAxis(0.0, 1.05, "share")
    # One bad start must not squeeze all the rest into a line.
    worst = min(float(np.min(band.median)) for band in bands.values())
    return ChartAxis(max(worst - 0.05, -0.5), 1.02, "R²")


def _dimmed(colour: Colour) -> Colour:
    red, green, blue = (c // 2 for c in colour)
    return red, green, blue
