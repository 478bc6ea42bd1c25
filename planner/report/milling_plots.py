"""Pictures of milling: stability at a pose, along a path, over a workspace; coupled receptances."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, LinearSegmentedColormap, LogNorm
from matplotlib.figure import Figure
from scipy.stats import rankdata

from planner.campaign.toolpath_poses import FeedAdvice, TurnAdvice
from planner.milling.coupling import AMPLIFICATION_LIMIT, CoupledFrf
from planner.milling.cut import Cut
from planner.milling.lobes import SampledLimits, StabilityLimit, depths_of
from planner.milling.path import PathLimits
from planner.report.plot_marks import AXES, MEASURED, MODEL, empty, magnitude, name_axes, panels

STABLE, UNSURE, LIMIT, POINT = "#dcefd9", "#f6e3b4", "black", "tab:red"
BANDS = 10  # of probability, in a colour each
WIDE = 8.0  # ratio of chatter frequencies from which their axis is logarithmic
ROOM = 1.25  # of the picture above the highest limit
RING = {"ls": "", "marker": "o", "mfc": "none", "mec": "tab:red", "ms": 13, "mew": 1.8}
FLOOR = 0.3  # of the least value: bands that reach below are cut off there


def lobes_figure(
    cut: Cut, found: Sequence[StabilityLimit], drawn: SampledLimits | None,
    point: tuple[float, float] | None,
) -> Figure:  # fmt: skip
    """Depth limits in mm over speeds in rpm, with probabilities; below it the chatter frequency."""
    rpm, depth = cut.speeds_rpm, 1e3 * depths_of(found)
    figure, grid = panels((9.0, 6.5), _title(cut), 2, height_ratios=(3, 1))
    upper, lower = grid[:, 0]
    highest = max(depth[np.isfinite(depth)], default=1e3 * cut.depth_m[1])
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
    last = rpm[-1] if rpm[-1] > rpm[0] else rpm[0] + 1
    upper.set(ylim=(0, top), xlim=(rpm[0], last), ylabel="axial depth (mm)")
    upper.grid(True, alpha=0.3)
    figure.legend(loc="outside lower center", ncols=3, fontsize=9)
    _frequencies(lower, rpm, found)
    if point is not None:
        lower.axvline(point[0], color=POINT, lw=0.8, ls=":")
    return figure


def _bands(panel, figure: Figure, rpm: np.ndarray, top: float, drawn: SampledLimits) -> None:
    colours = LinearSegmentedColormap.from_list("stable", ["white", UNSURE, STABLE])
    scale = ScalarMappable(BoundaryNorm(np.linspace(0, 1, BANDS + 1), colours.N), colours)
    for low in np.arange(BANDS) / BANDS:  # what is deeper is covered by what is surer
        depth = np.minimum(1e3 * drawn.robust(low), 2 * top)
        panel.fill_between(rpm, 0, depth, color=scale.to_rgba(low + 0.5 / BANDS), lw=0)
    figure.colorbar(scale, ax=panel, pad=0.01, aspect=30, label="probability of being stable")


def _frequencies(panel, rpm: np.ndarray, found: Sequence[StabilityLimit]) -> None:
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
    panel.set(ylabel="chatter (Hz)", xlabel="spindle speed (rpm)")
    panel.grid(True, alpha=0.3)


def _title(cut: Cut) -> str:
    sort = "slot" if cut.milling == "slot" else f"{cut.milling}-milling"
    immersion = "" if cut.milling == "slot" else f", {100 * cut.radial_immersion:g} % of diameter"
    teeth = "1 tooth" if cut.teeth == 1 else f"{cut.teeth} teeth"
    return f"Stability: {sort}{immersion}, {teeth}, diameter {1e3 * cut.diameter_m:g} mm"


def path_figure(limits: PathLimits, best_rpm: float, feed: FeedAdvice, cut: Cut) -> Figure:
    """Depths along a path over speeds, of all poses and each; below it over the feed's turn."""
    figure = empty((9.0, 6.5), f"Stability along {len(limits.names)} poses (grey: each)")
    upper, lower = figure.subplots(2, 1, height_ratios=(3, 1))
    rpm, top = cut.speeds_rpm, 1e3 * cut.depth_m[1]
    robust = np.minimum(1e3 * limits.robust_m, 2 * top)
    for row in robust:
        upper.plot(rpm, row, color="grey", lw=0.7, alpha=0.7)
    least = np.min(robust, axis=0)
    upper.fill_between(rpm, 0, least, color=STABLE, lw=0)
    upper.plot(rpm, least, color="tab:green", lw=2, label="whole path, 95 % probability")
    upper.axvline(best_rpm, color="tab:red", lw=1, ls="--", label="best speed")
    upper.set_ylim(0, min(top, 1.25 * float(np.max(np.where(robust > top, 0, robust))) or top))
    upper.set(xlabel="spindle speed (rpm)", ylabel="axial depth (mm)")
    upper.margins(x=0)
    figure.legend(fontsize=9, loc="outside lower center", ncols=2)
    # What is stable up to the largest depth asked for is drawn as that.
    lower.plot(feed.turn_deg, 1e3 * np.minimum(feed.depth_m, cut.depth_m[1]), ".-")
    lower.set_ylim(bottom=0)
    lower.set(xlabel="feed turned about the tool's axis (°)", ylabel="depth (mm)")
    for panel in (upper, lower):
        panel.grid(True, alpha=0.3)
    return figure


def turns_figure(
    advice: TurnAdvice, poses: tuple[str, ...], rpm: float, deepest_m: float
) -> Figure:
    """Depth over poses and angles."""
    figure = empty(
        (9.0, 4.8), f"Depth limit at {rpm:.0f} rpm (ring: best of a pose, dashed: best for all, "
        f"grey: cannot stand)",
    )  # fmt: skip
    panel = figure.subplots()
    # What is stable up to the largest depth asked for is drawn as that, not as unreachable.
    shown = np.ma.masked_invalid(1e3 * np.minimum(np.array(advice.depth_m), deepest_m).T)
    image = panel.imshow(shown, aspect="auto", origin="lower", cmap="viridis", norm=LogNorm())
    for i, best in enumerate(advice.best_deg):
        panel.plot(i, advice.turn_deg.index(best), "o", mfc="none", mec="white", ms=9, mew=1.6)
    panel.axhline(advice.turn_deg.index(advice.common_deg), color="tab:red", lw=1, ls="--")
    panel.set_xticks(range(len(poses)), poses, rotation=45, ha="right", fontsize=8)
    panel.set_yticks(range(len(advice.turn_deg)), [f"{a:g}" for a in advice.turn_deg])
    panel.set_ylabel("turned about the tool's axis (°)")
    panel.set_facecolor("lightgrey")
    _decimals(figure.colorbar(image, ax=panel, label="depth limit (mm)").ax)
    return figure


def map_figure(
    position_m: np.ndarray, features: np.ndarray, names: Sequence[str], depth_m: np.ndarray,
    rpm: float, wanted_m: float | None, deepest_m: float,
) -> Figure:  # fmt: skip
    """Depths (n,) stable with 95 % at poses (n, 3): from above, from the side, and over what of
    their features (n, d), named, the depth hangs on most.
    """
    what = f"What {len(depth_m)} poses of the workspace allow at {rpm:.0f} rpm (ring: the tightest)"
    figure = empty((13.0, 4.6), what)
    above, side, over = figure.subplots(1, 3)
    shown = 1e3 * np.minimum(depth_m, deepest_m)
    tight, (x, y, z) = int(np.argmin(shown)), position_m.T
    style = {"cmap": "viridis", "norm": LogNorm(), "s": 45, "edgecolor": "black", "lw": 0.3}
    for panel, across, name in ((above, y, "y"), (side, z, "z")):
        dots = panel.scatter(x, across, c=shown, **style)
        panel.plot(x[tight], across[tight], **RING)
        panel.set(xlabel="x (m)", ylabel=f"{name} (m)")
        panel.set_aspect("equal", "datalim")
    ranks = rankdata(np.column_stack([shown, features]), method="ordinal", axis=0)
    most = int(np.argmax(np.abs(np.corrcoef(ranks.T)[0, 1:])))
    over.plot(features[:, most], shown, "o", ms=5)
    over.plot(features[tight, most], shown[tight], **RING)
    name = names[most].rpartition("_")[0]
    over.set(xlabel=f"{name}, share of its range", ylabel="depth stable with 95 % (mm)")
    over.set_yscale("log")
    _decimals(over)
    if wanted_m is not None:
        over.axhline(1e3 * wanted_m, color="tab:red", ls="--", lw=1)
    for panel in (above, side, over):
        panel.grid(True, alpha=0.3)
    bar = figure.colorbar(dots, ax=[above, side], label="depth stable with 95 % probability (mm)")
    _decimals(bar.ax)
    return figure


def _decimals(panel: Axes) -> None:
    """A logarithmic axis of depths that may span little: no powers of ten."""
    panel.yaxis.set_major_formatter("{x:.3g}")
    panel.yaxis.set_minor_formatter("{x:.3g}")
    panel.tick_params(which="minor", labelsize=7)


def coupling_figure(before: CoupledFrf, coupled: CoupledFrf, reference: str) -> Figure:
    """Receptances |H| of motions per force, the tested tool's and the target's ± 2 sd.

    Below, line by line, how many times relative errors of the measured FRFs grew.
    """
    moved = [k for k in range(3) if np.all(np.isfinite(coupled.receptance[k, k]))]
    n = len(moved)
    layout = {"height_ratios": [1.0] * n + [0.7]}
    size, title = (4.6 * n + 2.0, 2.9 * n + 2.2), "Receptances of the tip, before and after"
    figure, grid = panels(size, title, n + 1, n, gridspec_kw=layout)
    f = coupled.frequency_hz
    for row, i in enumerate(moved):
        for column, j in enumerate(moved):
            panel = grid[row, column]
            mean, sd = 1e6 * coupled.receptance[i, j], 1e6 * coupled.sd[i, j]
            floor = FLOOR * np.abs(mean).min()
            magnitude(panel, f, mean, sd, floor, color=MODEL, lw=1.3, label="this tool")
            size = 1e6 * before.receptance[i, j]
            magnitude(panel, f, size, color=MEASURED, lw=0.9, label=reference)
            panel.set_ylim(bottom=floor)
            panel.set_title(f"response {AXES[i]}, hit {AXES[j]}", fontsize=9, loc="left", pad=3)
            panel.grid(True, which="both", alpha=0.2)
            if column == 0:
                panel.set_ylabel("|H| (µm/N)", fontsize=9)
    for other in grid[n]:
        other.remove()
    for panel in grid[n - 1]:
        panel.tick_params(labelbottom=True)
    grown = figure.add_subplot(grid[0, 0].get_gridspec()[n, :], sharex=grid[0, 0])
    grown.semilogy(f, coupled.amplification, color="black", lw=1.0)
    grown.axhline(AMPLIFICATION_LIMIT, color="tab:red", ls="--", lw=0.9)
    grown.set_ylabel("errors grow (times)", fontsize=9)
    grown.set_xlabel("frequency (Hz)", fontsize=9)
    grown.grid(True, which="both", alpha=0.2)
    if f[-1] / f[0] > 20:  # from which on the frequency axis is logarithmic
        grown.set_xscale("log")
    grown.set_xlim(f[0], f[-1])
    name_axes(figure, grid)
    return figure
