"""Learning curves as a Rerun recording: one series a strategy over the measurements."""

from collections.abc import Mapping
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from matplotlib.figure import Figure

from planner.report.frf_plots import png
from planner.report.learning_curves import Learning
from planner.report.rerun_stream import open_stream

QUANTITIES = {
    "rmse_percent": "frequency RMSE at unused poses (%)",
    "r2": "R²",
    "coverage95": "share in 95 % interval",
}


def write(
    strategies: Mapping[str, Learning], figure: Figure, rrd: Path, identity: str, name: str
) -> None:
    """Medians over repeats, and the figure; InputError if the file cannot be written."""
    views = [rrb.TimeSeriesView(origin=f"/{key}", name=text) for key, text in QUANTITIES.items()]
    picture = rrb.Spatial2DView(origin="/curves", name="learning curves")
    stream = open_stream(
        f"compare|{identity}", name, rrb.Blueprint(rrb.Tabs(picture, rrb.Vertical(*views))), rrd
    )
    image = rr.EncodedImage(contents=png(figure, dpi=150), media_type="image/png")
    stream.log("curves", image, static=True)
    for key in QUANTITIES:
        for strategy, curve in strategies.items():
            path = f"{key}/{strategy}"
            stream.log(path, rr.SeriesLines(names=strategy), static=True)
            for n, value in zip(curve.n, getattr(curve, key).median, strict=True):
                stream.set_time("measurement", sequence=int(n))
                stream.log(path, rr.Scalars(float(value)))
    stream.flush(timeout_sec=10.0)
    stream.disconnect()
