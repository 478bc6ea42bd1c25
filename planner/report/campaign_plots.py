"""Pictures of a campaign: poses left out one by one, maps over the workspace, FRFs of poses."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation
from scipy.stats import binom

from planner.campaign.campaign import Campaign
from planner.frf.frf import Frf
from planner.recording.joints import SCALES
from planner.report.plot_marks import (
    AXES,
    FAINTEST,
    MEASURED,
    MODEL,
    empty,
    magnitude,
    phase,
    plain_text,
)
from planner.surrogate.leave_one_out import LeaveOneOut

SHARES = np.linspace(0.02, 0.98, 49)
CHANCE = 0.9  # of a calibrated model's points that lie inside the grey band
NAMED = 3  # poses that are named


def left_out_figure(found: LeaveOneOut, poses: tuple[str, ...], title: str = "") -> Figure:
    """Coverage against nominal level (left), errors by pose in what was expected (right)."""
    figure = empty((11.0, 4.8), title)
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
    panel.axhspan(-1.96, 1.96, color="tab:green", alpha=0.1, lw=0, label="95 %")
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
    panel.legend(fontsize=8, ncols=min(score.shape[1] + 1, 5))
    panel.grid(True, alpha=0.25)


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
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    figure.subplots_adjust(0.07, 0.12, 0.97, 0.97, wspace=0.1)
    _fill(figure, left, x, frequency_hz, "viridis", f"natural frequency of mode {mode} (Hz)", flat)
    _fill(figure, right, x, sd_percent, "magma_r", f"sd of mode {mode}'s frequency (%)", flat)
    for panel in (left, right):
        for i in range(len(measured)):
            panel.plot(*measured[i], "o", ms=5, mfc="white", mec="black", mew=1.2)
        panel.use_sticky_edges = False  # of contours: poses at their edge are seen whole
        panel.set_xlabel(names[0])
    left.set_ylabel(names[1])
    middle = np.mean(left.get_xlim())
    for place, pose in zip(measured, poses, strict=True):
        side = 1 if place[0] < middle else -1  # a name runs towards the middle
        left.annotate(
            plain_text(pose), (place[0], place[1]), xytext=(4 * side, 4), fontsize=7,
            textcoords="offset points", ha="left" if side > 0 else "right",
            bbox={"facecolor": "white", "alpha": 0.7, "pad": 0.6, "lw": 0},
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


def frf_sheet(
    frequency_hz: np.ndarray, mean: np.ndarray, sd: np.ndarray, measured: Frf, modes_hz: np.ndarray
) -> Figure:
    """Columns xx, yy, zz: the model, mean (3, 3, F) ± 2 sd in m/s²/N, over what was measured.

    `modes_hz` (k,) are the predicted natural frequencies, drawn as dotted lines; above them the
    ground is grey. Coherence is left out where it is known of no column: it takes two hits.
    """
    coherent = bool(np.any(np.isfinite(measured.coherence)))
    # Placed by hand: a layout that places itself takes more time than all the drawing.
    figure = Figure(figsize=(11.0, 4.8 if coherent else 4.1))
    heights = (3.2, 1.3, 0.8)[: 3 if coherent else 2]
    panels = figure.subplots(len(heights), 3, sharex=True, height_ratios=heights)
    figure.subplots_adjust(0.065, 0.155 if coherent else 0.19, 0.99, 0.94, wspace=0.16, hspace=0.12)
    low, high = frequency_hz[[0, -1]]
    inside = (measured.frequency_hz >= low) & (measured.frequency_hz <= high)
    lines = measured.frequency_hz[inside]
    for i, axis in enumerate(AXES):
        one, h = measured.accelerance[i, i, inside], mean[i, i]
        floor = FAINTEST * float(np.abs(h).max())
        magnitude(panels[0, i], lines, one, color=MEASURED, lw=1.0, label="measured")
        magnitude(panels[0, i], frequency_hz, h, sd[i, i], floor, color=MODEL, lw=1, label="model")
        phase(panels[1, i], lines, one, color=MEASURED, lw=1.0)
        phase(panels[1, i], frequency_hz, h, sd[i, i], color=MODEL, lw=1.0)
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


SHOWN_FRFS = 6  # poses whose FRFs are drawn: the ones furthest off, then the first
SHOWN_MAPS = 8  # modes whose maps are drawn


def map_pictures(campaign: Campaign) -> dict[str, Any]:
    """Frequencies and their sds over the workspace: pictures, and what is said of them."""
    cell, used, found = campaign.cell, campaign.state.used, campaign.model.workspace_prediction
    joints = cell.robot.joints
    q = joints.internal([m.joints_deg for m in used]).reshape(-1, len(joints.names))
    x, measured, names, flat = _coordinates(campaign, q)
    percents = 100 * found.frequency_sd_hz / found.frequency_hz
    poses, count = tuple(m.pose for m in used), found.frequency_hz.shape[1]
    drawn = [
        workspace_map(x, names, f, sd, measured, poses, k, flat)
        for k, (f, sd) in enumerate(zip(found.frequency_hz.T, percents.T, strict=True), 1)
        if k <= SHOWN_MAPS
    ]
    means = " Several poses lie at one place of the map: shown is their mean, cell by cell."
    said = f"{len(x)} reachable poses stand for the workspace.{'' if flat else means}"
    said += f" Modes above {SHOWN_MAPS} are not drawn." if count > SHOWN_MAPS else ""
    return {"maps": drawn, "maps_say": said}


def _coordinates(
    campaign: Campaign, q: np.ndarray
) -> tuple[np.ndarray, np.ndarray, tuple[str, str], bool]:
    """Two coordinates of candidates (n, 2) and of measured poses (m, 2), and their names.

    Those of the workspace where it has two; else the two directions in which the tcp moves most.
    """
    cell = campaign.cell
    candidates, space = cell.candidates, cell.workspace
    if int(space.varying.sum()) == 2:
        lower, span = space.lower[space.varying], (space.upper - space.lower)[space.varying]
        units = [name.rsplit("_", 1)[-1] for name in space.feature_names]
        scale = np.array([SCALES.get(unit, 1.0) for unit in units])
        features = cell.features(q) if len(q) else np.empty((0, 2))
        shown = [(lower + one * span) * scale for one in (candidates.features, features)]
        first, second = map(_axis_name, space.feature_names)
        return shown[0], shown[1], (first, second), True
    pair = sorted(np.argsort(-np.ptp(candidates.position_m, axis=0), kind="stable")[:2].tolist())
    measured = cell.robot.forward_batch(q)[1] if len(q) else np.empty((0, 3))
    first, second = (f"{'xyz'[k]} of the tcp (m)" for k in pair)
    return candidates.position_m[:, pair], measured[:, pair], (first, second), False


def _axis_name(name: str) -> str:
    base, _, unit = name.rpartition("_")
    return f"{base} ({'°' if unit == 'deg' else unit})" if unit != "m" else f"{base} of the tcp (m)"


def frf_pictures(campaign: Campaign, worst: Sequence[str]) -> dict[str, Any]:
    """FRFs of the model with bands over the measured ones, of the `worst` poses first."""
    used = campaign.state.used
    names = dict.fromkeys([*(p for p in worst if any(m.pose == p for m in used)),
                           *(m.pose for m in used)])  # fmt: skip
    shown = [m for m in used if m.pose in list(names)[:SHOWN_FRFS]]
    if not shown:
        return {"frfs": [], "frfs_left": 0}
    lines = campaign.frequency_lines
    q = campaign.cell.robot.joints.internal([m.joints_deg for m in shown])
    mean, sd = campaign.frf_at(q, lines)
    expected = campaign.model.predict(q)
    drawn = []
    for i, m in enumerate(shown):
        frf = campaign.frf_of(m)
        figure = frf_sheet(lines, mean[i], sd[i], frf, expected.frequency_hz[i])
        drawn.append((m.pose, figure, not np.any(np.isfinite(frf.coherence))))
    return {"frfs": drawn, "frfs_left": len(used) - len(shown)}
