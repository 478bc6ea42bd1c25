"""Learning curves of sampling strategies: RMSE, R² and coverage by number of measurements."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, ScalarFormatter

MARKS = "osv^DPX*<>"


@dataclass(frozen=True, eq=False)
class Band:
    """Quartiles of a quantity over repeats: low, median, high, (t,) each."""

    low: np.ndarray
    median: np.ndarray
    high: np.ndarray

    @classmethod
    def of(cls, values: np.ndarray) -> "Band":
        """Of values (s, t): s repeats."""
        return cls(*np.percentile(values, (25, 50, 75), axis=0))


@dataclass(frozen=True, eq=False)
class Learning:
    """One strategy after n (t,) measurements."""

    n: np.ndarray
    rmse_percent: Band
    r2: Band
    coverage95: Band


def learning_figure(strategies: Mapping[str, Learning], title: str = "") -> Figure:
    """Medians with quartiles over repeats; RMSE on a logarithmic axis with the 1 % line."""
    figure = Figure(figsize=(11.0, 4.6), layout="constrained")
    panels = figure.subplot_mosaic([["rmse", "r2"], ["rmse", "coverage"]], width_ratios=(1.5, 1))
    for i, (name, curve) in enumerate(strategies.items()):
        style = {"color": f"C{i % 10}", "marker": MARKS[i % len(MARKS)], "label": name}
        _draw(panels["rmse"], curve.n, curve.rmse_percent, style, filled=True)
        _draw(panels["r2"], curve.n, curve.r2, style)
        _draw(panels["coverage"], curve.n, curve.coverage95, style)
    _finish(panels, strategies)
    figure.suptitle(title, fontsize=10)
    return figure


def _draw(panel: Axes, n: np.ndarray, band: Band, style: dict, filled: bool = False) -> None:
    panel.plot(n, band.median, ms=4, lw=1.4, **style)
    if filled:
        panel.fill_between(n, band.low, band.high, color=style["color"], alpha=0.15, lw=0)


def _finish(panels: Mapping[str, Axes], strategies: Mapping[str, Learning]) -> None:
    rmse, r2, coverage = panels["rmse"], panels["r2"], panels["coverage"]
    rmse.set_yscale("log")
    for axis in (rmse.yaxis,):
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_formatter(ScalarFormatter())
    rmse.tick_params(axis="y", which="minor", labelsize=7)
    rmse.axhline(1.0, color="black", lw=0.8, ls="--")
    rmse.annotate("1 %", (1.0, 1.0), xycoords=("axes fraction", "data"), fontsize=8,
                  xytext=(-4, 3), textcoords="offset points", ha="right")  # fmt: skip
    rmse.set_ylabel("frequency RMSE at unused poses (%)")
    # One bad start must not squeeze all the rest into a line.
    worst = min(float(np.min(c.r2.median)) for c in strategies.values())
    r2.set_ylim(max(worst - 0.05, -0.5), 1.02)
    r2.set_ylabel("R²")
    coverage.axhline(0.95, color="black", lw=0.8, ls="--")
    coverage.set_ylim(0.0, 1.05)
    coverage.set_ylabel("share in 95 % interval")
    for panel in panels.values():
        panel.xaxis.set_major_locator(MaxNLocator(integer=True))
        panel.grid(True, which="both", alpha=0.25)
    for panel in (rmse, coverage):
        panel.set_xlabel("measurements")
    rmse.legend(fontsize=8, title="median, band: quartiles", title_fontsize=8)
