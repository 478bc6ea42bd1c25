"""Picture of leave-one-out: do intervals hold what they say, and which poses surprise?"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy.stats import binom

from planner.report.plot_text import plain_text
from planner.surrogate.leave_one_out import LeaveOneOut

SHARES = np.linspace(0.02, 0.98, 49)
CHANCE = 0.9  # of a calibrated model's points that lie inside the grey band
NAMED = 3  # poses that are named


def left_out_figure(found: LeaveOneOut, poses: tuple[str, ...], title: str = "") -> Figure:
    """Coverage against nominal level (left), errors by pose in what was expected (right)."""
    figure = Figure(figsize=(11.0, 4.8), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(plain_text(title), fontsize=11)
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.8))
    _coverage(left, found)
    _errors(right, found, poses)
    return figure


def _coverage(panel: Axes, found: LeaveOneOut) -> None:
    known = found.rank[np.isfinite(found.rank)]
    percent = 100 * SHARES
    # Errors at one pose belong together, so that poses count, not values.
    count = max(int(np.isfinite(found.rank).any(axis=1).sum()), 1)
    low, high = (binom.ppf((1 + s * CHANCE) / 2, count, SHARES) / count for s in (-1, 1))
    panel.fill_between(percent, 100 * low, 100 * high, color="0.85", lw=0, label="by chance (90 %)")
    panel.plot([0, 100], [0, 100], color="black", lw=0.8, ls=":")
    if len(known):
        inside = found.coverage(tuple(SHARES.tolist()))
        panel.plot(percent, 100 * inside, color="tab:red", lw=1.6, label=f"{len(known)} values")
    panel.set(xlim=(0, 100), ylim=(0, 102), xlabel="interval claims to hold (%)")
    panel.set_ylabel("measured values inside (%)")
    panel.legend(fontsize=8, loc="lower right")
    panel.grid(True, alpha=0.25)


def _errors(panel: Axes, found: LeaveOneOut, poses: tuple[str, ...]) -> None:
    score = found.error / found.sd
    place = np.arange(len(poses))
    panel.axhspan(-1.96, 1.96, color="tab:green", alpha=0.1, lw=0)
    panel.axhline(0, color="black", lw=0.8, ls=":")
    for k in range(score.shape[1]):
        panel.plot(place, score[:, k], ls="", marker="o", ms=4, color=f"C{k % 10}",
                   label=f"mode {k + 1}")  # fmt: skip
    for i in found.worst(NAMED).tolist():
        k = int(np.nanargmax(np.abs(score[i]))) if np.isfinite(score[i]).any() else 0
        if abs(score[i, k]) > 1.96:
            text = f"{plain_text(poses[i])}, mode {k + 1}: {100 * found.error[i, k]:+.1f} %"
            right = i > len(poses) / 2  # a name there would run out of the axes
            panel.annotate(text, (i, score[i, k]), xytext=(-4 if right else 4, 4), fontsize=8,
                           textcoords="offset points", ha="right" if right else "left")  # fmt: skip
    panel.set_xticks(
        place,
        [plain_text(pose) for pose in poses],
        rotation=90,
        fontsize=7 if len(poses) < 40 else 5,
    )
    panel.set_ylabel("measured − predicted frequency, in expected sds")
    panel.margins(x=0.02, y=0.12)
    panel.legend(fontsize=8, ncols=min(score.shape[1], 4))
    panel.grid(True, alpha=0.25)
