"""Stability as charts of a Rerun recording: lobes, paths, turns of the tool, workspaces."""

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps

from planner.milling.cut import Cut
from planner.milling.lobes import Loss
from planner.milling.path import PathLimits
from planner.milling.uncertainty import PROBABILITY, SampledLimits
from planner.report.rerun_chart import (
    BRIGHT,
    GREY,
    Chart,
    ChartAxis,
    ChartBand,
    Colour,
    Curve,
    log_range,
)
from planner.report.rerun_sheet import Sheets

STABLE, UNSURE, ROBUST, WANTED = (40, 92, 48), (104, 84, 30), (110, 220, 110), (255, 110, 110)
HOPF, FLIP = (110, 160, 255), (255, 150, 40)
ROOM = 1.25  # of a chart above the highest depth
ALONE, BOTH = 2.2, 4.5  # width over height of a chart that fills a tab, of one of two
STROKES = 300  # of a band
MOST_NAMED = 6  # poses in a legend
CLASSES = 5  # of depths, each with a colour of its own
LOBES = (
    "Green is stable with 95 % probability, brown where samples disagree; white is the limit of "
    "the likeliest machine. Where a line has a gap every depth that was asked for is stable."
)
PATH = "Green is stable with 95 % probability at all poses, grey the limit of each."
MAP = "Poses by the depth that is stable with 95 % probability: bright is deep, red the tightest."


def lobes_sheets(
    cut: Cut, found: Sequence[Loss], drawn: SampledLimits | None,
    point: tuple[float, float] | None,
) -> Sheets:  # fmt: skip
    """Depths in mm over speeds in rpm, and the frequency of the chatter beyond."""
    depth = 1e3 * np.array([loss.depth_m for loss in found])
    most = 1e3 * cut.depth_m[1]
    highest = float(np.nanmax(depth)) if np.any(np.isfinite(depth)) else most
    top = min(most, ROOM * max(highest, 1e3 * point[1] if point else 0.0))
    robust, likely = depth, depth
    if drawn is not None:
        robust, likely = (1e3 * drawn.robust(p) for p in (PROBABILITY, 1 - PROBABILITY))
    bands = [_band(cut, "stable", np.zeros(len(found)), robust, top, STABLE)]
    curves = [_limit("limit", cut, depth, top, BRIGHT)]
    if drawn is not None:
        bands.append(_band(cut, "samples disagree", robust, likely, top, UNSURE))
        curves.append(_limit("stable with 95 %", cut, robust, top, ROBUST))
    if point is not None:
        place = np.array([point[0]]), np.array([1e3 * point[1]])
        curves.append(Curve("wanted", *place, WANTED, dots=True, thick=1.6))
    depths = Chart(
        "Stability lobes", _speeds(cut), ChartAxis(0.0, top, "axial depth (mm)"), curves, bands,
        BOTH,
    )  # fmt: skip
    return {"Stability lobes": (depths, _chatter(cut, found))}


def path_sheets(limits: PathLimits, cut: Cut, best_rpm: float, feed: tuple) -> Sheets:
    """As `lobes_sheets`, of all poses of a path; `feed` is (turns in °, depths in m)."""
    robust = 1e3 * limits.robust_m
    least = np.min(robust, axis=0)
    most = 1e3 * cut.depth_m[1]
    finite = least[np.isfinite(least) & (least <= most)]
    top = min(most, ROOM * float(finite.max())) if finite.size else most
    each = np.concatenate([np.append(np.minimum(row, 2 * top), np.nan) for row in robust])
    speeds = np.tile(np.append(cut.speeds_rpm, np.nan), len(robust))
    each = np.where(each > top, np.nan, each)
    stroke = np.full(2, best_rpm), np.array([0.0, top])
    depths = Chart(
        f"Depth stable with 95 % along {len(limits.names)} poses", _speeds(cut),
        ChartAxis(0.0, top, "axial depth (mm)"),
        (Curve("each pose", speeds, each, GREY, thick=0.4),
         _limit("whole path", cut, least, top, ROBUST), Curve("best speed", *stroke, WANTED)),
        (_band(cut, "stable", np.zeros(len(least)), least, top, STABLE),), BOTH,
    )  # fmt: skip
    turns, allowed = np.array(feed[0]), 1e3 * np.array(feed[1])
    known = allowed[np.isfinite(allowed)]
    high = 1.1 * float(known.max()) if known.size else most
    by_feed = Chart(
        "Feed turned about the tool's axis",
        ChartAxis(float(turns.min()), float(turns.max()), "turn (°)"),
        ChartAxis(0.0, high, "depth (mm)"), (Curve("", turns, allowed, ROBUST),
         Curve("", turns, allowed, ROBUST, dots=True)), wide=BOTH,
    )  # fmt: skip
    return {"Whole path": (depths, by_feed)}


def turns_sheets(turns_deg: np.ndarray, depth_m: np.ndarray, poses: Sequence[str]) -> Sheets:
    """What each of p poses allows (p, turns) at each turn about the tool's axis; NaN: no stand."""
    depth = np.where(np.isfinite(depth_m), 1e3 * depth_m, np.nan)
    colours, few = _colours(len(poses)), len(poses) <= MOST_NAMED
    curves = [
        Curve(name if few else "", turns_deg, row, colour)
        for name, row, colour in zip(poses, depth, colours, strict=True)
    ]
    least = np.min(depth, axis=0)  # NaN where one cannot stand
    curves.append(Curve("the tightest", turns_deg, least, BRIGHT, thick=2))
    known = depth[np.isfinite(depth)]
    axis = ChartAxis(0.0, 1.1 * float(known.max()) if known.size else 1.0, "depth limit (mm)")
    over = ChartAxis(float(turns_deg.min()) - 5.0, float(turns_deg.max()) + 5.0, "turn (°)")
    return {"Turns": (Chart("Tool turned about its axis", over, axis, curves, wide=ALONE),)}


def map_sheets(
    position_m: np.ndarray, depth_m: np.ndarray, feature: np.ndarray, name: str,
    wanted_m: float | None,
) -> Sheets:  # fmt: skip
    """What n poses (n, 3) allow with 95 %: from above, from the side, over a coordinate (n,)."""
    depth = 1e3 * depth_m
    tight = int(np.argmin(depth))
    edges = np.quantile(depth, np.linspace(0, 1, CLASSES + 1))
    member = np.clip(np.searchsorted(edges, depth, side="right") - 1, 0, CLASSES - 1)
    colours = _colours(CLASSES)

    def seen(a: int, b: int, title: str) -> Chart:
        x, y = position_m[:, a], position_m[:, b]
        curves = [
            Curve(f"{edges[k]:.3g} to {edges[k + 1]:.3g} mm", x[member == k], y[member == k],
                  colours[k], dots=True)
            for k in range(CLASSES)
        ]  # fmt: skip
        ring = Curve("tightest", x[[tight]], y[[tight]], WANTED, dots=True, thick=0.5)
        names = "xyz"
        return Chart(
            title, _around(x, f"{names[a]} (m)"), _around(y, f"{names[b]} (m)"), (*curves, ring),
            wide=ALONE,
        )  # fmt: skip

    over = _around(feature, f"{name}, share of its range")
    ring = Curve("tightest", feature[[tight]], depth[[tight]], WANTED, dots=True, thick=1.4)
    curves = [Curve("pose", feature, depth, ROBUST, dots=True), ring]
    if wanted_m is not None:
        ends = np.array([over.low, over.high])
        curves.append(Curve("wanted", ends, np.full(2, 1e3 * wanted_m), WANTED))
    y = ChartAxis(*log_range([depth]), "depth stable with 95 % (mm)", log=True)
    title = f"Over {name}, which matters most"
    return {
        "From above": (seen(0, 1, "From above"),),
        "From the side": (seen(0, 2, "From the side"),),
        f"Over {name}": (Chart(title, over, y, curves, wide=ALONE),),
    }


def _speeds(cut: Cut) -> ChartAxis:
    rpm = cut.speeds_rpm
    high = float(rpm[-1]) if rpm[-1] > rpm[0] else float(rpm[0]) + 1.0
    return ChartAxis(float(rpm[0]), high, "spindle speed (rpm)")


def _limit(name: str, cut: Cut, depth: np.ndarray, top: float, colour: Colour) -> Curve:
    """Without a limit, or above the chart, there is a gap."""
    return Curve(name, cut.speeds_rpm, np.where(depth <= top, depth, np.nan), colour)


def _band(
    cut: Cut, name: str, low: np.ndarray, high: np.ndarray, top: float, colour: Colour
) -> ChartBand:
    """Where nothing limits the depth it reaches to the chart's top."""
    low, high = (np.minimum(np.where(np.isfinite(v), v, top), top) for v in (low, high))
    rpm = np.linspace(cut.speeds_rpm[0], cut.speeds_rpm[-1], STROKES)  # thick strokes end round
    low, high = (np.interp(rpm, cut.speeds_rpm, v) for v in (low, high))
    return ChartBand(name, rpm, low, high, colour)


def _chatter(cut: Cut, found: Sequence[Loss]) -> Chart:
    hertz = np.array([loss.chatter_hz for loss in found])
    curves = [
        Curve(kind, cut.speeds_rpm, np.where([loss.kind == kind for loss in found], hertz, np.nan),
              colour, dots=True, thick=0.7)
        for kind, colour in (("hopf", HOPF), ("flip", FLIP))
    ]  # fmt: skip
    known = hertz[np.isfinite(hertz)]
    low, high = (0.0, 1.0) if not known.size else (0.9 * known.min(), 1.1 * known.max())
    axis = ChartAxis(float(low), float(high), "chatter (Hz)")
    return Chart("Frequency of the chatter", _speeds(cut), axis, curves, wide=BOTH)


def _around(values: np.ndarray, label: str) -> ChartAxis:
    low, high = float(values.min()), float(values.max())
    room = 0.05 * (high - low) or 0.1
    return ChartAxis(low - room, high + room, label)


def _colours(count: int) -> list[Colour]:
    shades = colormaps["viridis"](np.linspace(0.4, 1.0, max(count, 1)))[:, :3]
    return [(int(r), int(g), int(b)) for r, g, b in 255 * shades]
