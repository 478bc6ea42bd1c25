"""Engineering plots with matplotlib (log axes, bands); figures are returned, callers save them."""

import io
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from planner.report.plot_text import plain_text

AXES = ("x", "y", "z")
MEASURED, MODEL = "black", "tab:red"


def frf_figure(
    frequency_hz: np.ndarray,
    mean: np.ndarray,
    sd: np.ndarray,
    measured_hz: np.ndarray | None = None,
    measured: np.ndarray | None = None,
    coherence: np.ndarray | None = None,
    title: str = "",
) -> Figure:
    """Direct FRFs xx, yy, zz of the model, mean (3, 3, F) ± 2 sd, over the measured ones.

    All in m/s²/N; `measured`, `coherence` (3, 3, M) on `measured_hz` (M,).
    """
    figure = Figure(figsize=(7.5, 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(3, 1, sharex=True)
    for i, panel in enumerate(panels):
        size = np.abs(mean[i, i])
        low, high = np.maximum(size - 2 * sd[i, i], 1e-3 * size.max()), size + 2 * sd[i, i]
        panel.fill_between(frequency_hz, low, high, color=MODEL, alpha=0.25, lw=0)
        panel.semilogy(frequency_hz, size, color=MODEL, lw=1.2, label="model, ± 2 sd")
        if measured is not None and measured_hz is not None:
            panel.semilogy(
                measured_hz, np.abs(measured[i, i]), color=MEASURED, lw=0.9, label="measured"
            )
        if coherence is not None and measured_hz is not None:
            right = panel.twinx()
            right.plot(measured_hz, coherence[i, i], color="tab:blue", lw=0.5, alpha=0.6)
            right.set_ylim(0, 1.05)
            right.set_ylabel("coherence", color="tab:blue", fontsize=8)
        panel.set_xlim(frequency_hz[0], frequency_hz[-1])
        panel.set_ylabel(f"|H {AXES[i]}{AXES[i]}| (m/s²/N)", fontsize=8)
        panel.grid(True, which="both", alpha=0.25)
    panels[0].legend(fontsize=8, loc="upper left")
    panels[-1].set_xlabel("frequency (Hz)")
    figure.suptitle(plain_text(title), fontsize=10)
    return figure


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
