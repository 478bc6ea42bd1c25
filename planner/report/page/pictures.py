"""Chapters of the report that are pictures: quality, maps, FRFs."""

import numpy as np

from planner.campaign.left_out import found_without
from planner.recording.joints import SCALES
from planner.report.frf_plots import png
from planner.report.frf_sheet import frf_sheet
from planner.report.leave_one_out_plots import left_out_figure
from planner.report.page.chapters import forecast, mode_rows, remarks
from planner.report.page.facts import Facts
from planner.report.page.html import Markup, joined, paragraphs, picture, section, table, tag
from planner.report.workspace_map import workspace_map

SHOWN_FRFS = 6  # poses whose FRFs are drawn: the ones furthest off, then the first
SHOWN_MAPS = 8  # modes whose maps are drawn
DPI = 100
POSITIONS = ("x of the tcp (m)", "y of the tcp (m)", "z of the tcp (m)")


def quality(facts: Facts) -> Markup:
    """How sure the model is, and whether it may be: each pose predicted without it."""
    rows = mode_rows(facts)
    said = table(
        ("", "frequency (Hz)", "sd, root mean square (%)", "sd, largest (%)", "damping (%)"),
        rows,
        "Over the workspace, by the model after all measurements",
    )
    parts: list[object] = [forecast(facts), remarks(facts), said]
    left = facts.status.leave_one_out
    parts.append(tag("h3", "Held-out quality: each measured pose predicted without it"))
    parts.append(paragraphs(*left.text))
    if left.values:
        figure = left_out_figure(*found_without(facts.model))
        parts.append(
            picture(
                png(figure, DPI),
                "Left: share of measured frequencies inside the intervals, against what the "
                "intervals claim; on the diagonal they are honest, below it too narrow. Right: "
                "errors by pose in units of the expected sd; the green band holds 95 %.",
            )
        )
        parts.append(_errors(facts))
    return section("How good the model is", *parts, id_="quality")


def _errors(facts: Facts) -> Markup:
    rows = [
        (
            f.pose, str(f.mode), f"{f.measured_hz:.3f}", f"{f.predicted_hz:.3f} ± {f.sd_hz:.3f}",
            f"{100 * (f.measured_hz / f.predicted_hz - 1):+.2f}",
        )
        for f in facts.status.leave_one_out.frequencies
    ]  # fmt: skip
    header = ("pose", "mode", "measured (Hz)", "predicted without it (Hz)", "off by (%)")
    listing = table(header, rows)
    return tag("details", tag("summary", f"All {len(rows)} values"), listing)


def maps(facts: Facts) -> Markup:
    """Frequencies and their uncertainty over the workspace."""
    cell, model = facts.campaign.cell, facts.model
    joints = cell.robot.joints
    q = joints.internal([m.joints_deg for m in facts.used]).reshape(-1, len(joints.names))
    x, measured, names, flat = _coordinates(facts, q)
    found = model.workspace_prediction
    poses = tuple(m.pose for m in facts.used)
    drawn = []
    count = found.frequency_hz.shape[1]
    for k in range(min(count, SHOWN_MAPS)):
        figure = workspace_map(
            x, names, found.frequency_hz[:, k], facts.sd_percent[:, k], measured, poses, k + 1, flat
        )
        drawn.append(picture(png(figure, DPI), f"Mode {k + 1}; circles are measured poses."))
    way = "" if flat else (
        " Several poses lie at one place of the map: shown is their mean, cell by cell."
    )  # fmt: skip
    left = f" Modes above {SHOWN_MAPS} are not drawn." if count > SHOWN_MAPS else ""
    text = f"{len(x)} reachable poses stand for the workspace.{way}{left}"
    return section("Natural frequencies over the workspace", tag("p", text), *drawn, id_="maps")


def _coordinates(facts: Facts, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, tuple, bool]:
    """Two coordinates of candidates (n, 2) and of measured poses (m, 2), and their names.

    Those of the workspace where it has two; else the two directions in which the tcp moves most.
    """
    cell = facts.campaign.cell
    candidates, space = cell.candidates, cell.workspace
    if int(space.varying.sum()) == 2:
        lower, span = space.lower[space.varying], (space.upper - space.lower)[space.varying]
        units = [name.rsplit("_", 1)[-1] for name in space.feature_names]
        scale = np.array([SCALES.get(unit, 1.0) for unit in units])
        names = [_axis_name(name) for name in space.feature_names]

        def shown(features: np.ndarray) -> np.ndarray:
            return (lower + features * span) * scale

        measured = cell.features(q) if len(q) else np.empty((0, 2))
        return shown(candidates.features), shown(measured), (names[0], names[1]), True
    a, b = sorted(np.argsort(-np.ptp(candidates.position_m, axis=0), kind="stable")[:2].tolist())
    measured = cell.robot.forward_batch(q)[1] if len(q) else np.empty((0, 3))
    pair = [a, b]
    return candidates.position_m[:, pair], measured[:, pair], (POSITIONS[a], POSITIONS[b]), False


def _axis_name(name: str) -> str:
    if name.endswith("_deg"):
        return f"{name.removesuffix('_deg')} (°)"
    if name.endswith("_mm"):
        return f"{name.removesuffix('_mm')} (mm)"
    return f"{name.removesuffix('_m')} of the tcp (m)"


def frfs(facts: Facts) -> Markup:
    """FRFs of the model with bands over the measured ones."""
    used = facts.used
    if not used:
        return section("FRFs", tag("p", "None is measured yet."), id_="frfs")
    campaign, table_ = facts.campaign, facts.campaign.cell.config.modes
    worst = [p for p in facts.status.leave_one_out.worst if any(m.pose == p for m in used)]
    order = [*worst, *(m.pose for m in used if m.pose not in worst)][:SHOWN_FRFS]
    shown = [m for m in used if m.pose in order]
    lines = campaign.frequency_lines
    q = campaign.cell.robot.joints.internal([m.joints_deg for m in shown])
    mean, sd = campaign.frf(q, lines)
    expected = facts.model.predict(q)
    drawn = []
    for i, m in enumerate(shown):
        modes = expected.frequency_hz[i]
        frf = campaign.frf_of(m, table_)
        figure = frf_sheet(lines, mean[i], sd[i], frf, modes)
        single = "" if np.any(np.isfinite(frf.coherence)) else (
            " Coherence is not known: it takes two hits an axis."
        )  # fmt: skip
        says = f"{m.pose}: direct FRFs; dotted lines are the model's natural frequencies.{single}"
        drawn.append(tag("h3", f"Pose {m.pose}"))
        drawn.append(picture(png(figure, DPI), says))
    text = (
        "Accelerance at the hit point in the direction of the hit. These poses are part of what "
        "the model knows; how well it does without a pose stands above."
    )
    left = len(used) - len(shown)
    more = f" {left} further poses are not drawn." if left else ""
    return section("FRFs with their bands", tag("p", text + more), joined(drawn), id_="frfs")
