"""Maps of natural frequencies and of their uncertainty over the workspace."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from planner.report.plot_text import plain_text

BINS = 14  # across, where several poses lie at one place


def workspace_map(
    x: np.ndarray,
    names: tuple[str, str],
    frequency_hz: np.ndarray,
    sd_percent: np.ndarray,
    measured: np.ndarray,
    poses: tuple[str, ...],
    mode: int,
    flat: bool,
) -> Figure:
    """One mode over two coordinates: frequency (left), its standard deviation (right).

    x (n, 2) with axes `names`; frequency_hz, sd_percent (n,); measured (m, 2) are the poses
    measured. `flat`: each place has one pose, and contours are drawn; else means by cell.
    """
    figure = Figure(figsize=(11.0, 4.4))
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    figure.subplots_adjust(0.07, 0.12, 0.97, 0.97, wspace=0.1)
    _fill(figure, left, x, frequency_hz, "viridis", f"natural frequency of mode {mode} (Hz)", flat)
    _fill(figure, right, x, sd_percent, "magma_r", f"sd of mode {mode}'s frequency (%)", flat)
    for panel in (left, right):
        for i in range(len(measured)):
            panel.plot(*measured[i], "o", ms=5, mfc="white", mec="black", mew=1.2)
        panel.set_xlabel(names[0])
    left.set_ylabel(names[1])
    for place, pose in zip(measured, poses, strict=True):
        left.annotate(
            plain_text(pose), (place[0], place[1]), xytext=(4, 4), textcoords="offset points",
            fontsize=7, bbox={"facecolor": "white", "alpha": 0.7, "pad": 0.6, "lw": 0},
        )  # fmt: skip
    return figure


def _fill(
    figure: Figure, panel: Axes, x: np.ndarray, values: np.ndarray, colours: str, label: str,
    flat: bool,
) -> None:  # fmt: skip
    if flat:
        # Neighbours are found in shares of the ranges: millimetres and degrees make slivers.
        shares = (x - x.min(axis=0)) / np.maximum(np.ptp(x, axis=0), 1e-12)
        triangles = Triangulation(shares[:, 0], shares[:, 1]).triangles
        both = Triangulation(x[:, 0], x[:, 1], triangles)
        image = panel.tricontourf(both, values, levels=14, cmap=colours)
    else:
        image = panel.hexbin(x[:, 0], x[:, 1], values, gridsize=BINS, cmap=colours, mincnt=1)
    figure.colorbar(image, ax=panel, label=label, pad=0.02)
    panel.margins(0.04)
