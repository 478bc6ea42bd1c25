"""Answers of `stability` by spindle speed: at one pose, and along a path."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

from planner.campaign import cut_source, toolpath_poses
from planner.milling import lobes
from planner.milling.cut import Cut, load_cut
from planner.milling.machine import Multiplier, multiplier
from planner.milling.path import TURNS_DEG, PathLimits, limits_along, limits_by_feed
from planner.milling.structure import Structure, limit_remarks, out_of_band_remark
from planner.progress import ProgressCallback, part_of
from planner.report.answer import Answer, plain
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
LOBES = "Where a line has a gap no mode that was measured limits the depths asked for."
PATH = "Depths that are stable with 95 % probability at all poses, and at each."


def depth_mm(depth_m: float, every: str, unit: str = "") -> str:
    """A depth in mm, of three digits, or what stands for `every` that was asked for."""
    return f"{significant(1e3 * depth_m, 3)}{unit}" if np.isfinite(depth_m) else every


@dataclass(frozen=True, eq=False, kw_only=True)
class LimitsBySpeed(Answer):
    """First losses of stability at each speed (n,) of a cut, and depths stable with 95 %, in m.

    inf where every depth that was asked for is stable.
    """

    cut: Cut
    losses: tuple[lobes.StabilityLimit, ...]
    robust_m: np.ndarray
    remarks: tuple[str, ...] = ()
    simulated: bool = False
    plots: tuple[str, ...] = ()
    rrd: str | None = None

    def keys(self) -> dict[str, Any]:
        """Those of its JSON beside what all have."""
        return {}

    def to_json(self) -> dict[str, Any]:
        """Per speed the smallest depth that chatters (null: none), and how."""
        each = self.losses
        return plain({
            "spindle_rpm": self.cut.speeds_rpm, "depth_limit_m": [one.depth_m for one in each],
            "kind": [one.kind for one in each], "chatter_hz": [one.chatter_hz for one in each],
            "depth_limit_m_at_95": self.robust_m, "method": self.cut.method,
            "remarks": self.remarks, "simulated": self.simulated, "plots": self.plots,
            "rrd": self.rrd, **self.keys(),
        })  # fmt: skip

    def _table(self, title: str, last: str, cells: Sequence[str]) -> Table:
        """Some of the speeds, and `cells` (n,) of a last column."""
        columns = "spindle (rpm)", "depth limit (mm)", "at 95 % (mm)", "chatter (Hz)"
        each = -(-len(cells) // MOST_ROWS)
        some = f", one of every {each} speeds (--json: all)" if each > 1 else ""
        made = table(f"{title}, {self.cut.method.replace('_', ' ')}{some}", *columns, last)
        # The speed at which least is stable is never one that is left out.
        least = int(np.argmin(np.where(np.isfinite(self.robust_m), self.robust_m, np.inf)))
        for i in sorted({*range(0, len(cells), each), least, len(cells) - 1}):
            depths = self.losses[i].depth_m, self.robust_m[i]
            made.add_row(
                f"{self.cut.speeds_rpm[i]:.0f}", *(depth_mm(depth, "–") for depth in depths),
                number(self.losses[i].chatter_hz, ".1f"), cells[i],
            )  # fmt: skip
        return made


@dataclass(frozen=True, eq=False, kw_only=True)
class StabilityReport(LimitsBySpeed):
    """Answer of `stability` at one pose; `there` is what holds at the point that was asked for."""

    there: Multiplier | None = None

    def keys(self) -> dict[str, Any]:
        """ "depth_error": the limits' relative changes when more points per period are computed."""
        point = {}
        if self.there is not None:
            point = {"multiplier": self.there.size, "multiplier_error": self.there.error}
        return {"depth_error": [one.error for one in self.losses], **point}

    def text(self) -> Group:
        """A table of speeds, then what else there is to say."""
        kinds = [one.kind or "none found" for one in self.losses]
        lines = [text for kind, text in KINDS.items() if kind in kinds]
        if self.there is not None:
            verdict = "stable" if self.there.size < 1 else "not stable"
            lines.append(
                f"At the point |µ| = {self.there.size:.6f}, the growth of a disturbance from one "
                f"period to the next: {verdict}."
            )
        made = self._table("First loss of stability", "kind", kinds)
        return Group(made, *map(Text, lines), *remarks(self.remarks), *self.end)


def stability_of(
    asked: cut_source.StabilityRequest, pictures: Pictures, progress: ProgressCallback
) -> StabilityReport:
    """Raises InputError where source, cut or point are wrong."""
    cut, point = load_cut(asked.cut), asked.wanted
    structure = cut_source.structure_of(asked, cut)
    machine, samples = structure.machine(cut), structure.samples(cut, asked.samples)
    found = lobes.stability_limits(machine, part_of(progress, 0.0, LOBES_SHARE if samples else 1.0))
    depth = robust = lobes.depths_of(found)
    outside = out_of_band_remark(structure, np.array([loss.chatter_hz for loss in found]))
    said, drawn = [*structure.remarks, *([outside] if outside else [])], None
    if samples:
        drawn = lobes.sampled_limits(samples, found, part_of(progress, LOBES_SHARE, 1.0))
        robust, off = drawn.robust(), drawn.robust_sd()
        off = off[np.isfinite(off)]
        if off.size:
            said.append(
                f"Depths at {100 * lobes.PROBABILITY:.0f} % are from {len(drawn.depth_m)} samples, "
                f"known to ± {100 * np.median(off):.1f} % (median over speeds)."
            )
        said += limit_remarks(structure, cut, depth, ~drawn.open(depth))
    simulated = structure.frf is not None and structure.frf.simulated
    there = None if point is None else multiplier(machine, *point)
    answer = StabilityReport(
        cut=cut, losses=found, robust_m=robust, remarks=tuple(said), simulated=simulated,
        there=there,
    )  # fmt: skip

    def figures():
        from planner.report.milling_plots import lobes_figure

        return {"stability": lobes_figure(cut, found, drawn, point)}

    name = ", ".join(filter(None, (asked.source.name, asked.pose)))
    return answer.with_figures(pictures, figures, name, LOBES)


@dataclass(frozen=True, eq=False, kw_only=True)
class PathReport(LimitsBySpeed):
    """Answer of `stability` along a path: per speed (n,) the pose that allows the least."""

    limits: PathLimits
    feed: toolpath_poses.FeedAdvice
    turn: toolpath_poses.TurnAdvice | None = None

    @property
    def best(self) -> tuple[float, float]:
        """The best speed (rpm), and what the whole path allows there (m)."""
        at = self.limits.best_speed
        return float(self.cut.speeds_rpm[at]), float(self.robust_m[at])

    @property
    def tightest(self) -> list[str]:
        """(n,) the pose that allows the least."""
        return [self.limits.names[i] for i in self.limits.tightest]

    def keys(self) -> dict[str, Any]:
        """ "best_depth_m_at_95" is what the whole path allows at "best_spindle_rpm"."""
        rpm, depth = self.best
        return {"tightest_pose": self.tightest, "poses": self.limits.names, "best_spindle_rpm": rpm,
                "best_depth_m_at_95": depth, "feed": self.feed, "turn": self.turn}  # fmt: skip

    def text(self) -> Group:
        """A table of speeds, then the best of them."""
        poses, (rpm, depth) = self.limits.names, self.best
        known = zip(self.tightest, self.losses, strict=True)
        tightest = [pose if np.isfinite(loss.depth_m) else "–" for pose, loss in known]
        made = self._table(f"{len(poses)} poses", "tightest pose", tightest)
        said = (
            f"Best speed for the whole path: {rpm:.0f} rpm allows {depth_mm(depth, EVERY, ' mm')} "
            f"with 95 % probability."
        )
        turned = self.turn.text(poses) if self.turn is not None else ""
        said = " ".join(filter(None, (said, self.feed.text, turned)))
        return Group(made, Text(said), *remarks(self.remarks), *self.end)


def path_report(
    asked: cut_source.StabilityRequest,
    way: toolpath_poses.PathRequest,
    cut: Cut,
    pictures: Pictures,
    progress: ProgressCallback,
) -> PathReport:
    """Of every pose of an npz, or of a campaign along a way."""
    if not asked.source.is_dir():
        way.check_none(asked.source)
        poses = cut_source.structures_of_file(asked, cut)
        limits = limits_along(poses, cut, asked.samples, progress)
        answer = _at_all(poses, limits, cut)
    else:
        travelled = toolpath_poses.PathPoses.of(asked, way, cut)
        poses = travelled.structures(cut)
        limits = limits_along(
            poses, cut, asked.samples, part_of(progress, 0.0, 0.5 if way.turns else 1.0)
        )
        answer = _at_all(poses, limits, cut)
        if way.turns:
            turned = toolpath_poses.turn_advice(
                travelled, cut, answer.best[0], part_of(progress, 0.5, 1.0)
            )
            answer = replace(answer, turn=turned)
        feed = travelled.feed_in_base(answer.feed.turn_deg[answer.feed.best])
        said = (
            *cut_source.outside(travelled.campaign, travelled.names, travelled.q),
            *cut_source.beyond_the_tip(travelled.campaign, cut), *answer.remarks,
        )  # fmt: skip
        answer = replace(answer, feed=replace(answer.feed, direction_base=feed), remarks=said)

    def figures():
        from planner.report.milling_plots import path_figure, turns_figure

        rpm = answer.best[0]
        made = {"path": path_figure(limits, rpm, answer.feed, cut)}
        if answer.turn is not None:
            made["turns"] = turns_figure(answer.turn, limits.names, rpm, cut.depth_m[1])
        return made

    return answer.with_figures(pictures, figures, asked.source.name, PATH)


def _at_all(poses: list[tuple[str, Structure]], limits: PathLimits, cut: Cut) -> PathReport:
    said = [
        f"{name}: {text}" for (name, structure), row in zip(poses, limits.found, strict=True)
        if (text := out_of_band_remark(structure, np.array([loss.chatter_hz for loss in row])))
    ]  # fmt: skip
    rows = zip(poses, limits.depth_m, limits.known, strict=True)
    said += [
        f"{name}: {text}" for (name, structure), row, known in rows
        for text in limit_remarks(structure, cut, row, known)
    ]  # fmt: skip
    first = np.argmin(limits.depth_m, axis=0)
    turned = limits_by_feed(poses, cut, float(cut.speeds_rpm[limits.best_speed]))
    return PathReport(
        cut=cut,
        losses=tuple(limits.found[p][i] for i, p in enumerate(first)),
        robust_m=np.min(limits.robust_m, axis=0),
        remarks=tuple(said),
        simulated=any(one.frf is not None and one.frf.simulated for _, one in poses),
        limits=limits,
        feed=toolpath_poses.FeedAdvice(tuple(map(float, TURNS_DEG)), tuple(map(float, turned))),
    )
