"""The picture of stability lobes that hangs on the machine."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from planner.milling.cut import Cut
from planner.milling.lobes import Loss
from planner.milling.uncertainty import SampledLimits

STABLE, UNSURE, LIMIT, POINT = "#dcefd9", "#f6e3b4", "black", "tab:red"
ROWS = 240  # of depths at which probabilities are drawn
WIDE = 8.0  # ratio of chatter frequencies from which their axis is logarithmic
ROOM = 1.25  # of the picture above the highest limit


def lobes_figure(
    cut: Cut, found: Sequence[Loss], drawn: SampledLimits | None,
    point: tuple[float, float] | None, mark: str = "",
) -> Figure:  # fmt: skip
    """Depth limits in mm over speeds in rpm, with probabilities; below it the chatter frequency."""
    rpm, depth = cut.speeds_rpm, 1e3 * np.array([loss.depth_m for loss in found])
    figure = Figure(figsize=(9.0, 6.5), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    highest = np.nanmax(depth) if np.any(np.isfinite(depth)) else 1e3 * cut.depth_m[1]
    top = min(1e3 * cut.depth_m[1], ROOM * max(highest, 1e3 * point[1] if point else 0.0))
    shown = np.where(np.isfinite(depth), depth, 2 * top)
    if drawn is None:
        upper.fill_between(rpm, 0, np.minimum(shown, top), color=STABLE, lw=0)
    else:
        _bands(upper, figure, rpm, top, drawn)
    upper.plot(rpm, shown, color=LIMIT, lw=1.5, label="limit")
    if drawn is not None:
        robust = 1e3 * drawn.robust()
        robust = np.where(np.isfinite(robust), robust, 2 * top)
        upper.plot(rpm, robust, color="tab:green", lw=1.8, label="stable with 95 % probability")
    if point is not None:
        upper.plot(point[0], 1e3 * point[1], "x", color=POINT, ms=11, mew=2.5, label="wanted")
    upper.set_ylim(0, top)
    upper.set_xlim(rpm[0], rpm[-1] if rpm[-1] > rpm[0] else rpm[0] + 1)
    upper.set_ylabel("axial depth (mm)")
    upper.grid(True, alpha=0.3)
    figure.legend(loc="outside upper center", ncols=3, fontsize=9)
    upper.set_title(mark + _title(cut), fontsize=11)
    _frequencies(lower, rpm, found)
    if point is not None:
        lower.axvline(point[0], color=POINT, lw=0.8, ls=":")
    return figure


def _bands(panel, figure: Figure, rpm: np.ndarray, top: float, drawn: SampledLimits) -> None:
    from matplotlib.colors import LinearSegmentedColormap

    depths = np.linspace(0, top, ROWS)
    probability = drawn.probability(depths * 1e-3)
    colours = LinearSegmentedColormap.from_list("stable", ["white", UNSURE, STABLE])
    filled = panel.contourf(
        rpm, depths, probability.T, levels=np.linspace(0, 1, 11), cmap=colours, extend="neither"
    )
    bar = figure.colorbar(filled, ax=panel, pad=0.01, aspect=30)
    bar.set_label("probability of being stable")


def _frequencies(panel, rpm: np.ndarray, found: Sequence[Loss]) -> None:
    hertz = np.array([loss.chatter_hz for loss in found])
    for kind, colour in (("hopf", "tab:blue"), ("flip", "tab:orange")):
        of_kind = np.array([loss.kind == kind for loss in found])
        if np.any(of_kind):
            panel.plot(rpm[of_kind], hertz[of_kind], ".", ms=3.5, color=colour, label=f"_{kind}")
            panel.text(
                1.01, 0.7 if kind == "hopf" else 0.4, f"● {kind}", color=colour, fontsize=9,
                transform=panel.transAxes,
            )  # fmt: skip
    if np.any(np.isfinite(hertz)) and np.nanmax(hertz) > WIDE * np.nanmin(hertz):
        panel.set_yscale("log")
    panel.set_ylabel("chatter (Hz)")
    panel.set_xlabel("spindle speed (rpm)")
    panel.grid(True, alpha=0.3)


def _title(cut: Cut) -> str:
    sort = "slot" if cut.milling == "slot" else f"{cut.milling}-milling"
    immersion = "" if cut.milling == "slot" else f", {100 * cut.radial_immersion:g} % of diameter"
    teeth = "1 tooth" if cut.teeth == 1 else f"{cut.teeth} teeth"
    return f"Stability: {sort}{immersion}, {teeth}, diameter {1e3 * cut.diameter_m:g} mm"
