"""Learning curves of sampling strategies: RMSE, R² and coverage by number of measurements."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from planner.compare.curves import Curves
from planner.report.plot_marks import empty

MARKS = "osv^DPX*<>"


def learning_figure(strategies: Mapping[str, Curves], title: str) -> Figure:
    """Medians with quartiles over repeats; RMSE on a logarithmic axis with the 1 % line."""
    figure = empty((11.0, 4.6), title)
    panels = figure.subplot_mosaic([["rmse", "r2"], ["rmse", "coverage"]], width_ratios=(1.5, 1))
    for i, (name, curve) in enumerate(strategies.items()):
        style: dict[str, Any] = {
            "color": f"C{i % 10}",
            "marker": MARKS[i % len(MARKS)],
            "label": name,
        }
        low, median, high = np.percentile(curve.frequency_rmse_percent, (25, 50, 75), axis=0)
        panels["rmse"].fill_between(curve.n, low, high, color=style["color"], alpha=0.15, lw=0)
        medians = {"rmse": median, "r2": np.median(curve.r2, axis=0)}
        medians["coverage"] = np.median(curve.coverage95, axis=0)
        for key, values in medians.items():
            panels[key].plot(curve.n, values, ms=4, lw=1.4, **style)
    _finish(panels, strategies)
    return figure


def _finish(panels: Mapping[str, Axes], strategies: Mapping[str, Curves]) -> None:
    rmse, r2, coverage = panels["rmse"], panels["r2"], panels["coverage"]
    rmse.set_yscale("log")
    rmse.yaxis.set_major_formatter(ScalarFormatter())
    rmse.yaxis.set_minor_formatter(ScalarFormatter())
    rmse.tick_params(axis="y", which="minor", labelsize=7)
    rmse.axhline(1.0, color="black", lw=0.8, ls="--")
    rmse.annotate("1 %", (1.0, 1.0), xycoords=("axes fraction", "data"), fontsize=8,
                  xytext=(-4, 3), textcoords="offset points", ha="right")  # fmt: skip
    rmse.set_ylabel("frequency RMSE at unused poses (%)")
    # One bad start must not squeeze all the rest into a line.
    worst = min(float(np.min(np.median(c.r2, axis=0))) for c in strategies.values())
    r2.set(ylim=(max(worst - 0.05, -0.5), 1.02), ylabel="R²")
    coverage.axhline(0.95, color="black", lw=0.8, ls="--")
    coverage.set_ylim(min(0.8, coverage.get_ylim()[0]), 1.02)
    coverage.set_ylabel("share in 95 % interval")
    for panel in panels.values():
        panel.xaxis.set_major_locator(MaxNLocator(integer=True))
        panel.grid(True, which="both", alpha=0.25)
    for panel in (rmse, coverage):
        panel.set_xlabel("measurements")
    rmse.legend(fontsize=8, title="median, band: quartiles", title_fontsize=8)
