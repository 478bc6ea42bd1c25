"""Pictures of modes from responses alone."""

import numpy as np
from matplotlib.figure import Figure

from planner.modal.operating import OperatingModes
from planner.modal.stabilisation import stable
from planner.report.modal_plots import SINGULAR, STABLE, UNSTABLE
from planner.report.plot_marks import COLUMNS, label_modes, panels

TONE = "tab:purple"


def operating_figure(found: OperatingModes, title: str = "") -> Figure:
    """Poles of all orders over the singular values of the responses' cross spectra."""
    figure, grid = panels((12.0, 7.0 if len(found.modes) <= COLUMNS else 10.0), title)
    panel = grid[0, 0]
    values = np.linalg.svd(np.moveaxis(found.spectrum, -1, 0), compute_uv=False).T
    inside = (found.spectrum_hz >= found.band_hz[0]) & (found.spectrum_hz <= found.band_hz[1])
    for k, one in enumerate(values[: len(SINGULAR)]):
        label = f"singular value {k + 1}"
        panel.semilogy(found.spectrum_hz[inside], one[inside], color=SINGULAR[k], label=label)
    panel.set_xlim(*found.band_hz)
    panel.set_xlabel("frequency (Hz)")
    panel.set_ylabel("cross power of the responses (each of unit variance)")
    orders = panel.twinx()
    kept = {complex(p) for line in stable(found.diagram) for p in line.poles}
    for is_stable, style, label in ((False, UNSTABLE, "unstable"), (True, STABLE, "stable")):
        points = [
            (abs(pole) / (2 * np.pi), entry.order)
            for entry in found.diagram.sets
            for pole in entry.poles
            if (complex(pole) in kept) == is_stable
        ]
        x, y = np.array(points, float).reshape(-1, 2).T
        orders.plot(x, y, **style, label=f"{label} pole")
    orders.set_ylabel("model order")
    for k, tone in enumerate(found.tones_hz):
        panel.axvline(tone, color=TONE, ls="--", lw=1.0, label=None if k else "tone, no mode")
    label_modes(panel, found)
    handles = [*panel.get_legend_handles_labels()[0], *orders.get_legend_handles_labels()[0]]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=8)
    return figure
