"""Direct FRFs of a pose on one sheet: magnitude, phase and coherence, with the model's bands."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from planner.frf.frf import Frf
from planner.report.frf_plots import AXES, MEASURED, MODEL

FAINTEST = 1e-3  # of the largest magnitude: what is smaller is not shown


def frf_sheet(
    frequency_hz: np.ndarray,
    mean: np.ndarray,
    sd: np.ndarray,
    measured: Frf,
    modes_hz: np.ndarray,
) -> Figure:
    """Columns xx, yy, zz: the model, mean (3, 3, F) ± 2 sd in m/s²/N, over what was measured.

    `modes_hz` (k,) are the predicted natural frequencies, drawn as dotted lines; above them the
    ground is grey. Coherence is left out where it is known of no column: it takes two hits.
    """
    coherent = bool(np.any(np.isfinite(measured.coherence)))
    # Placed by hand: a layout that places itself takes more time than all the drawing.
    figure = Figure(figsize=(11.0, 4.8 if coherent else 4.1))
    FigureCanvasAgg(figure)
    heights = (3.2, 1.3, 0.8)[: 3 if coherent else 2]
    panels = figure.subplots(len(heights), 3, sharex=True, height_ratios=heights)
    figure.subplots_adjust(0.065, 0.155 if coherent else 0.19, 0.99, 0.94, wspace=0.16, hspace=0.12)
    low, high = frequency_hz[[0, -1]]
    inside = (measured.frequency_hz >= low) & (measured.frequency_hz <= high)
    lines = measured.frequency_hz[inside]
    for i, axis in enumerate(AXES):
        one, h = measured.accelerance[i, i, inside], mean[i, i]
        _magnitude(panels[0, i], frequency_hz, h, sd[i, i], lines, one)
        _phase(panels[1, i], frequency_hz, h, sd[i, i], lines, one)
        if coherent:
            panels[2, i].plot(lines, measured.coherence[i, i, inside], color="tab:blue", lw=0.8)
            panels[2, i].set(ylim=(0, 1.05))
        panels[-1, i].set(xlim=(low, high), xlabel="frequency (Hz)")
        panels[0, i].set_title(f"hit along {axis}, response along {axis}", fontsize=9)
        for panel in panels[:, i]:
            for mode in modes_hz:
                panel.axvline(mode, color="0.45", lw=0.7, ls=":")
            panel.axvspan(
                min(float(np.nanmax(modes_hz, initial=low)), high), high, color="0.92", lw=0,
                zorder=0, label="above the counted modes" if panel is panels[0, 0] else None,
            )  # fmt: skip
            panel.grid(True, alpha=0.25)
            panel.tick_params(labelsize=8)
    names = ("accelerance (m/s²/N)", "phase (°)", "coherence")
    for panel, name in zip(panels[:, 0], names, strict=False):
        panel.set_ylabel(name, fontsize=8)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=4, fontsize=8)
    return figure


def _magnitude(panel, lines, mean, sd, measured_hz, measured) -> None:
    size = np.abs(mean)
    least = FAINTEST * float(size.max())
    band = np.maximum(size - 2 * sd, least), size + 2 * sd
    panel.fill_between(lines, *band, color=MODEL, alpha=0.25, lw=0, label="± 2 sd")
    panel.semilogy(measured_hz, np.abs(measured), color=MEASURED, lw=1.0, label="measured")
    panel.semilogy(lines, size, color=MODEL, lw=1.0, label="model")


def _phase(panel, lines, mean, sd, measured_hz, measured) -> None:
    """Phase in °; its band is the widest angle under which a circle of 2 sd is seen."""
    angle = np.rad2deg(np.angle(mean))
    half = np.rad2deg(np.arcsin(np.minimum(2 * sd / np.maximum(np.abs(mean), 1e-300), 1.0)))
    # Drawn on the turn of the circle where the model is, so that ±180° do not jump back and forth.
    seen = np.rad2deg(np.angle(measured))
    near = np.interp(measured_hz, lines, np.rad2deg(np.unwrap(np.angle(mean))))
    seen = seen + 360 * np.round((near - seen) / 360)
    smooth = np.rad2deg(np.unwrap(np.deg2rad(angle)))
    panel.fill_between(lines, smooth - half, smooth + half, color=MODEL, alpha=0.25, lw=0)
    panel.plot(measured_hz, seen, color=MEASURED, lw=1.0)
    panel.plot(lines, smooth, color=MODEL, lw=1.0)
