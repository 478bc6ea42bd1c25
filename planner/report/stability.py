"""Answers of `stability` by spindle speed: at one pose, and along a path."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

from planner.campaign.cut_source import StabilityRequest, outside, structure_of, structures_of_file
from planner.campaign.toolpath_poses import (
    FeedAdvice,
    PathPoses,
    PathRequest,
    TurnAdvice,
    turn_advice,
)
from planner.milling.cut import Cut, load_cut
from planner.milling.lobes import (
    PROBABILITY,
    SampledLimits,
    StabilityLimit,
    sampled_limits,
    stability_limits,
)
from planner.milling.machine import multiplier
from planner.milling.path import TURNS_DEG, PathLimits, limits_along, limits_by_feed
from planner.milling.structure import Structure, limit_remarks, out_of_band_remark
from planner.progress import ProgressCallback, no_progress, part_of
from planner.report.answer import Answer
from planner.report.pictures import Pictures
from planner.report.text import number, remarks, table
from planner.words import significant

MOST_ROWS = 24  # of speeds that the text shows
LOBES_SHARE = 0.2  # of the time, where samples follow
EVERY = "every depth that was asked for"
KINDS = {
    "hopf": "hopf: chatter at a frequency of its own, beside multiples of the tooth passing.",
    "flip": "flip: chatter at odd multiples of half the tooth-passing frequency.",
}
LOBES = "Where a line has a gap every depth that was asked for is stable."
PATH = "Depths that are stable with 95 % probability at all poses, and at each."


def depth_mm(depth_m: float, every: str, unit: str = "") -> str:
    """A depth in mm, of three digits, or what stands for `every` that was asked for."""
    return f"{significant(1e3 * depth_m, 3)}{unit}" if np.isfinite(depth_m) else every


@dataclass(frozen=True, eq=False, kw_only=True)
class LimitsBySpeed(Answer):
    """Per speed (n,): the smallest depth that chatters, and how.

    `depth_limit_m` is null where every depth that was asked for is stable, `depth_limit_m_at_95`
    is stable with 95 % probability.
    """

    spindle_rpm: np.ndarray
    depth_limit_m: np.ndarray
    kind: tuple[str | None, ...]
    chatter_hz: np.ndarray
    depth_limit_m_at_95: np.ndarray
    method: str
    remarks: tuple[str, ...] = ()
    simulated: bool = False
    plots: tuple[str, ...] = ()
    rrd: str | None = None

    def _table(self, title: str, last: str, cells: Sequence[str]) -> Table:
        """Some of the speeds, at most so many, and `cells` (n,) of a last column."""
        columns = "spindle (rpm)", "depth limit (mm)", "at 95 % (mm)", "chatter (Hz)"
        made = table(f"{title}, {self.method.replace('_', ' ')}", *columns, last)
        for i in range(0, len(cells), max(1, -(-len(cells) // MOST_ROWS))):
            depths = self.depth_limit_m[i], self.depth_limit_m_at_95[i]
            made.add_row(
                f"{self.spindle_rpm[i]:.0f}", *(depth_mm(depth, "–") for depth in depths),
                number(self.chatter_hz[i], ".1f"), cells[i],
            )  # fmt: skip
        return made


@dataclass(frozen=True, eq=False, kw_only=True)
class StabilityReport(LimitsBySpeed):
    """Answer of `stability`, per speed (n,).

    `depth_error` is the limit's relative change when more points per period are computed.
    `multiplier` is the largest |µ| at the asked point, `multiplier_error` its numerical error.
    """

    depth_error: np.ndarray
    multiplier: Any = msgspec.UNSET
    multiplier_error: Any = msgspec.UNSET

    def text(self) -> Group:
        """A table of speeds, then what else there is to say."""
        made = self._table("First loss of stability", "kind", [k or "stable" for k in self.kind])
        lines = [text for kind, text in KINDS.items() if kind in self.kind]
        if self.multiplier is not msgspec.UNSET:
            verdict = "stable" if self.multiplier < 1 else "not stable"
            lines.append(f"At the point |µ| = {self.multiplier:.6f}: {verdict}.")
        return Group(made, *map(Text, lines), *remarks(self.remarks), *self.end)


def stability_of(
    asked: StabilityRequest,
    pictures: Pictures | None = None,
    progress: ProgressCallback = no_progress,
) -> StabilityReport:
    """Raises InputError where source, cut or point are wrong."""
    cut = load_cut(asked.cut)
    point = asked.wanted
    structure = structure_of(asked, cut)
    machine, samples = structure.machine(cut), structure.samples(cut, asked.samples)
    found = stability_limits(machine, part_of(progress, 0.0, LOBES_SHARE if samples else 1.0))
    drawn = None
    if samples:
        drawn = sampled_limits(samples, found, part_of(progress, LOBES_SHARE, 1.0))
    answer = _at_one(cut, structure, found, drawn)
    if point is not None:
        there = multiplier(machine, *point)
        answer = replace(answer, multiplier=there.size, multiplier_error=there.error)

    def figures():
        from planner.report.milling_plots import lobes_figure

        return {"stability": lobes_figure(cut, found, drawn, point)}

    name = ", ".join(filter(None, (asked.source.name, asked.pose)))
    return answer.with_figures(pictures or Pictures(), figures, name, LOBES)


def _at_one(
    cut: Cut, structure: Structure, found: tuple[StabilityLimit, ...], drawn: SampledLimits | None
) -> StabilityReport:
    depth = robust = np.array([loss.depth_m for loss in found])
    chatter_hz = np.array([loss.chatter_hz for loss in found])
    outside = out_of_band_remark(structure, chatter_hz)
    said = [*structure.remarks, *([outside] if outside else [])]
    if drawn is not None:
        robust, off = drawn.robust(), drawn.robust_sd()
        off = off[np.isfinite(off)]
        if off.size:
            said.append(
                f"Depths at {100 * PROBABILITY:.0f} % are from {len(drawn.depth_m)} samples, known "
                f"to ± {100 * np.median(off):.1f} % (median over speeds)."
            )
        said += limit_remarks(structure, cut, depth, ~drawn.open(depth))
    return StabilityReport(
        spindle_rpm=cut.speeds_rpm,
        depth_limit_m=depth,
        kind=tuple(loss.kind for loss in found),
        chatter_hz=chatter_hz,
        depth_limit_m_at_95=robust,
        method=cut.method,
        depth_error=np.array([loss.error for loss in found]),
        remarks=tuple(said),
        simulated=structure.frf is not None and structure.frf.simulated,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class PathReport(LimitsBySpeed):
    """Answer of `stability` along a path, per speed (n,) the pose that allows the least.

    `best_depth_m_at_95` is what the whole path allows at `best_spindle_rpm`.
    """

    tightest_pose: tuple[str, ...]
    poses: tuple[str, ...]
    best_spindle_rpm: float
    best_depth_m_at_95: float
    feed: FeedAdvice
    turn: TurnAdvice | None = None

    def text(self) -> Group:
        """A table of speeds, then the best of them."""
        known = zip(self.tightest_pose, self.depth_limit_m, strict=True)
        tightest = [pose if np.isfinite(depth) else "–" for pose, depth in known]
        made = self._table(f"{len(self.poses)} poses", "tightest pose", tightest)
        best = depth_mm(self.best_depth_m_at_95, EVERY, " mm")
        said = (
            f"Best speed for the whole path: {self.best_spindle_rpm:.0f} rpm allows {best} with "
            f"95 % probability."
        )
        turned = self.turn.text(self.poses) if self.turn is not None else ""
        said = " ".join(filter(None, (said, self.feed.text, turned)))
        return Group(made, Text(said), *remarks(self.remarks), *self.end)


def path_report(
    asked: StabilityRequest,
    way: PathRequest,
    cut: Cut,
    pictures: Pictures,
    progress: ProgressCallback = no_progress,
) -> PathReport:
    """Of every pose of an npz, or of a campaign along a way."""
    if not asked.source.is_dir():
        way.check_none(asked.source)
        poses = structures_of_file(asked, cut)
        limits = limits_along(poses, cut, asked.samples, progress)
        answer = _at_all(poses, limits, cut)
    else:
        travelled = PathPoses.of(asked, way, cut)
        poses = travelled.structures(cut)
        limits = limits_along(
            poses, cut, asked.samples, part_of(progress, 0.0, 0.5 if way.turns else 1.0)
        )
        answer = _at_all(poses, limits, cut)
        if way.turns:
            turned = turn_advice(
                travelled, cut, answer.best_spindle_rpm, part_of(progress, 0.5, 1.0)
            )
            answer = replace(answer, turn=turned)
        feed = travelled.feed_in_base(answer.feed.turn_deg[answer.feed.best])
        said = *outside(travelled.campaign, travelled.names, travelled.q), *answer.remarks
        answer = replace(answer, feed=replace(answer.feed, direction_base=feed), remarks=said)

    def figures():
        from planner.report.milling_plots import path_figure, turns_figure

        made = {"path": path_figure(limits, answer.best_spindle_rpm, answer.feed, cut)}
        if answer.turn is not None:
            rpm = answer.best_spindle_rpm
            made["turns"] = turns_figure(answer.turn, answer.poses, rpm, cut.depth_m[1])
        return made

    return answer.with_figures(pictures, figures, asked.source.name, PATH)


def _at_all(poses: list[tuple[str, Structure]], limits: PathLimits, cut: Cut) -> PathReport:
    first = np.argmin(limits.depth_m, axis=0)
    tightest = [limits.found[p][i] for i, p in enumerate(first)]
    robust, best = np.min(limits.robust_m, axis=0), limits.best_speed
    rpm = cut.speeds_rpm
    said = [
        f"{name}: {text}" for (name, structure), row in zip(poses, limits.found, strict=True)
        if (text := out_of_band_remark(structure, np.array([loss.chatter_hz for loss in row])))
    ]  # fmt: skip
    rows = zip(poses, limits.depth_m, limits.known, strict=True)
    said += [
        f"{name}: {text}" for (name, structure), row, known in rows
        for text in limit_remarks(structure, cut, row, known)
    ]  # fmt: skip
    turned = limits_by_feed(poses, cut, float(rpm[best]))
    return PathReport(
        spindle_rpm=rpm,
        depth_limit_m=np.min(limits.depth_m, axis=0),
        kind=tuple(loss.kind for loss in tightest),
        chatter_hz=np.array([loss.chatter_hz for loss in tightest]),
        depth_limit_m_at_95=robust,
        tightest_pose=tuple(limits.names[i] for i in limits.tightest),
        poses=limits.names,
        best_spindle_rpm=float(rpm[best]),
        best_depth_m_at_95=float(robust[best]),
        feed=FeedAdvice(tuple(map(float, TURNS_DEG)), tuple(map(float, turned))),
        method=cut.method,
        remarks=tuple(said),
        simulated=any(one.frf is not None and one.frf.simulated for _, one in poses),
    )
