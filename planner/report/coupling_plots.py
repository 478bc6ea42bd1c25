"""Pictures of a receptance coupling: the tip's receptances before and after, and how noise grew."""

import numpy as np
from matplotlib.figure import Figure

from planner.milling.coupling import AMPLIFICATION_LIMIT, CoupledFrf
from planner.report.plot_marks import AXES, MEASURED, MODEL, magnitude, panels

FLOOR = 0.3  # of the least value: bands that reach below are cut off there
MANY_DECADES = 20.0  # ratio of the band's ends from which the frequency axis is logarithmic


def coupling_figure(
    before: CoupledFrf | None, coupled: CoupledFrf, title: str, reference: str
) -> Figure:
    """Receptances |H| of motions per force, the tested tool's and the target's ± 2 sd.

    Below, line by line, how many times relative errors of the measured FRFs grew.
    """
    moved = [k for k in range(3) if np.all(np.isfinite(coupled.receptance[k, k]))]
    n = len(moved)
    layout = {"height_ratios": [1.0] * n + [0.7]}
    figure, grid = panels((4.6 * n + 2.0, 2.9 * n + 2.2), title, n + 1, n, gridspec_kw=layout)
    f = coupled.frequency_hz
    for row, i in enumerate(moved):
        for column, j in enumerate(moved):
            panel = grid[row, column]
            mean, sd = 1e6 * coupled.receptance[i, j], 1e6 * coupled.sd[i, j]
            floor = FLOOR * np.abs(mean).min()
            magnitude(panel, f, mean, sd, floor, color=MODEL, lw=1.3, label="this tool")
            if before is not None:
                size = 1e6 * before.receptance[i, j]
                magnitude(panel, f, size, color=MEASURED, lw=0.9, label=reference)
            panel.set_ylim(bottom=floor)
            panel.set_title(f"response {AXES[i]}, hit {AXES[j]}", fontsize=9, loc="left", pad=3)
            panel.grid(True, which="both", alpha=0.2)
            if column == 0:
                panel.set_ylabel("|H| (µm/N)", fontsize=9)
    grown = grid[n, 0]
    for other in grid[n, 1:]:
        other.remove()
    for panel in grid[n - 1, 1:]:
        panel.tick_params(labelbottom=True)
        panel.set_xlabel("frequency (Hz)", fontsize=9)
    grown.semilogy(f, coupled.amplification, color="black", lw=1.0)
    grown.axhline(AMPLIFICATION_LIMIT, color="tab:red", ls="--", lw=0.9)
    grown.set_ylabel("errors grow (times)", fontsize=9)
    grown.set_xlabel("frequency (Hz)", fontsize=9)
    grown.grid(True, which="both", alpha=0.2)
    if f[-1] / f[0] > MANY_DECADES:
        grown.set_xscale("log")
    grown.set_xlim(f[0], f[-1])
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=9)
    return figure
