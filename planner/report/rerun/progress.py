"""Figures of a measurement, and series of what was learned in Rerun's own plots over time."""

from collections.abc import Callable

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from matplotlib import colormaps
from matplotlib.figure import Figure

from planner.campaign.labels import LabelledPose
from planner.campaign.model import Model
from planner.dataset.measure import MeasuredPose
from planner.report.plot_marks import AXES, FAINTEST, magnitude, name_axes, panels

LINES = 300  # frequency lines of a plot: as many as its width shows
SIZE = (7.0, 3.6)  # inches
NEAR_TARGET = 4.0  # times the target: what is shown; before the first measurement sds are far above
EXPECTED, SPREAD = (255, 150, 40), (150, 95, 40)
MEASURED = TARGET = (235, 235, 235)
ALL = (150, 154, 158)


def frf_figures(
    model: Model, before: Model | None, pose: LabelledPose, measured: MeasuredPose | None
) -> list[Figure]:
    """Direct FRFs xx, yy, zz of the tool: measured, predicted before that, and believed now."""
    low, high = model.cell.config.modes.band_hz
    lines = np.linspace(low, high, LINES)
    now = model.frf(pose.q[None], lines)[0][0]
    then = None if before is None or not before.labelled else before.frf(pose.q[None], lines)
    frf, figures = None if measured is None else measured.frf, []
    for i, axis in enumerate(AXES):
        title = f"{pose.pose}: response along {axis} to hits along {axis}"
        figure, grid = panels(SIZE, title)
        panel = grid[0, 0]
        floor = FAINTEST * float(np.abs(now[i, i]).max())
        if then is not None:
            mean, sd = then[0][0, i, i], then[1][0, i, i]
            style = {"color": "tab:orange", "label": "predicted before"}
            magnitude(panel, lines, mean, sd, floor, **style)
        magnitude(panel, lines, now[i, i], color="tab:blue", lw=1.8, label="believed now")
        if frf is not None:
            inside = (frf.frequency_hz >= low) & (frf.frequency_hz <= high)
            seen = frf.frequency_hz[inside], frf.accelerance[i, i, inside]
            magnitude(panel, *seen, color="black", lw=1.0, label="measured")
        panel.set_xlim(low, high)
        panel.grid(True, which="both", alpha=0.25)
        name_axes(figure, grid, "frequency (Hz)", "|H| (m/s²/N)")
        figures.append(figure)
    return figures


def force_figure(measured: MeasuredPose) -> Figure:
    """The force of one hit along each axis around its peak."""
    title = "Force, one hit an axis" if measured.hits else "FRFs were imported: no hits to show"
    figure, grid = panels(SIZE, title)
    panel = grid[0, 0]
    shown = {hit.axis[-1]: hit for hit in reversed(measured.hits)}
    for axis, hit in sorted(shown.items()):
        ms = 1000 * np.arange(hit.force_n.size) / hit.sampling_rate_hz
        ms = ms - ms[int(np.argmax(np.abs(hit.force_n)))]
        panel.plot(ms, np.abs(hit.force_n), label=f"along {axis}")
    panel.set_xlim(-5.0, 35.0)
    panel.grid(True, alpha=0.25)
    name_axes(figure, grid, "time after the peak (ms)", "force (N)")
    return figure


def measured_modes(pose: LabelledPose, before: Model | None) -> dict[str, float]:
    """Frequencies (Hz) and damping (%) of a pose's modes, and what, if anything, was expected."""
    rows: dict[str, float] = {}
    said = before.predict(pose.q[None]) if before is not None and before.labelled else None
    for k, mode in enumerate(pose.modes, 1):
        if mode is not None:
            rows[f"frequency/mode_{k}/measured"] = mode.frequency_hz
            rows[f"damping/mode_{k}"] = 100 * mode.damping_ratio
            rows[f"damping/mode_{k}_low"] = 100 * (mode.damping_ratio - 2 * mode.damping_sd)
            rows[f"damping/mode_{k}_high"] = 100 * (mode.damping_ratio + 2 * mode.damping_sd)
        if said is not None:
            hz, sd = said.frequency_hz[0, k - 1], said.frequency_sd_hz[0, k - 1]
            rows[f"frequency/mode_{k}/expected"] = hz
            rows[f"frequency/mode_{k}/low"] = hz - 2 * sd
            rows[f"frequency/mode_{k}/high"] = hz + 2 * sd
    return rows


def uncertainty(sd_percent: np.ndarray, target_percent: float) -> dict[str, float]:
    """The sd (count,) in % of each frequency over the workspace, of all, and the target."""
    rows = {f"learning/mode_{k}": sd for k, sd in enumerate(sd_percent, 1)}
    return rows | {
        "learning/all": float(np.sqrt(np.mean(sd_percent**2))),
        "learning/target": target_percent,
    }


class MeasuredSeries:
    """Series over the number of measurements; `arrange` shows those below a path.

    Rerun keeps what it was told: where a measurement is taken back, all series start again at
    another path.
    """

    def __init__(self, stream: rr.RecordingStream, arrange: Callable[[str], None]):
        self._stream, self._arrange = stream, arrange
        self._rows: dict[int, dict[str, float]] = {}
        self._start = 0

    @property
    def path(self) -> str:
        """Below which the series are that hold."""
        return f"progress/{self._start}"

    def log(self, number: int, values: dict[str, float]) -> None:
        """Values after so many measurements, by series; those not finite are left out."""
        values = {name: v for name, v in values.items() if np.isfinite(v)}
        known = self._rows.get(number, {})
        again = any(known.get(name, v) != v for name, v in values.items())
        again |= max(self._rows, default=0) > number
        if not again and values.items() <= known.items():
            return
        self._rows = {n: row for n, row in self._rows.items() if n < number}
        self._rows[number] = known | values
        if again:
            self._start += 1
            self._arrange(self.path)
        for n, row in self._rows.items() if again else [(number, values)]:
            self._stream.set_time("measurement", sequence=n)
            told = {name for earlier, known in self._rows.items() if earlier < n for name in known}
            for name, value in row.items():
                if name not in told:
                    self._stream.log(f"{self.path}/{name}", *_style(name), static=True)
                self._stream.log(f"{self.path}/{name}", rr.Scalars(value))


def _style(name: str) -> list[rr.SeriesLines | rr.SeriesPoints]:
    """How a series is drawn: measured values as points, others as lines."""
    kind = name.rpartition("/")[2]
    own = {
        "measured": MEASURED, "expected": EXPECTED, "low": SPREAD, "high": SPREAD,
        "target": TARGET, "all": ALL,
    }  # fmt: skip
    label = {"low": "expected − 2 sd", "high": "expected + 2 sd", "all": "all modes"}
    said = label.get(kind, kind.replace("_low", " − 2 sd").replace("_high", " + 2 sd"))
    said = said.replace("_", " ")
    colour = own.get(kind)
    if colour is None:  # of a mode, bright enough for a dark ground
        rgb = colormaps["tab10"]((int(kind.split("_")[1]) - 1) % 10)[:3]
        colour = tuple((np.array(rgb) * 155 + 100).astype(int).tolist())
    thin = kind.endswith(("low", "high"))
    line = rr.SeriesLines(colors=colour, names=said, widths=0.7 if thin else 1.8)
    dots = rr.SeriesPoints(colors=colour, names=said, marker_sizes=4.0)
    return [dots] if kind == "measured" else [line] if thin or kind == "target" else [line, dots]


def progress_views(path: str, count: int, target_percent: float) -> rrb.Container:
    """What is not known yet, and the frequencies measured against those expected."""
    modes = [
        rrb.TimeSeriesView(origin=f"/{path}/frequency/mode_{k}", name=f"mode {k}: frequency (Hz)")
        for k in range(1, count + 1)
    ]
    damping = rrb.TimeSeriesView(
        origin=f"/{path}/damping",
        name="damping (%), ± 2 sd; colours as on the left",
        plot_legend=rrb.PlotLegend(visible=False),
    )
    return rrb.Horizontal(
        learning_view(path, target_percent),
        rrb.Grid(*modes, damping),
        column_shares=[2, 3],
        name="Progress",
    )


def learning_view(path: str, target_percent: float) -> rrb.TimeSeriesView:
    """The sd of the natural frequencies over the workspace, near its target."""
    return rrb.TimeSeriesView(
        origin=f"/{path}/learning",
        name="What is not known yet: sd of the natural frequencies (%)",
        axis_y=rrb.ScalarAxis(range=(0.0, NEAR_TARGET * target_percent)),
        plot_legend=rrb.PlotLegend("RightTop"),
    )
