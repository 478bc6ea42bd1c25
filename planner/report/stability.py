"""Answers of `stability` by spindle speed: at one pose, and along a path."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from planner.campaign import cut_source, toolpath_poses
from planner.errors import InputError
from planner.milling import lobes
from planner.milling.cut import Cut, load_cut
from planner.milling.machine import multiplier
from planner.milling.path import TURNS_DEG, PathLimits, limits_along, limits_by_feed
from planner.milling.structure import Structure, limit_remarks, out_of_band_remark
from planner.progress import ProgressCallback, part_of
from planner.report.answer import Done
from planner.report.pictures import Pictures
from planner.report.text import ending, number, remarks, table
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


def stability_of(
    asked: cut_source.StabilityRequest, pictures: Pictures, progress: ProgressCallback
) -> Done:
    """Answer of `stability` at one pose. Raises InputError where source, cut or point are wrong.

    "depth_error" are the limits' relative changes when more points per period are computed.
    """
    cut, point = load_cut(asked.cut), asked.wanted
    structure = cut_source.structure_of(asked, cut)
    machine, samples = structure.machine(cut), structure.samples(cut, asked.samples)
    found = lobes.stability_limits(machine, part_of(progress, 0.0, LOBES_SHARE if samples else 1.0))
    robust, drawn = lobes.depths_of(found), None
    outside = out_of_band_remark(structure, np.array([loss.chatter_hz for loss in found]))
    told = [*structure.remarks, *([outside] if outside else [])]
    if samples:
        drawn = lobes.sampled_limits(samples, found, part_of(progress, LOBES_SHARE, 1.0))
        told += [*_how_sure(drawn), *limit_remarks(structure, cut, robust, ~drawn.open(robust))]
        robust = drawn.robust()

    def draw():
        from planner.report.milling_plots import lobes_figure

        return {"stability": lobes_figure(cut, found, drawn, point)}

    kinds = [one.kind or "none found" for one in found]
    lines = [text for kind, text in KINDS.items() if kind in kinds]
    more: dict[str, Any] = {"depth_error": [one.error for one in found]}
    if point is not None:
        growth, error = multiplier(machine, *point)
        more |= {"multiplier": growth, "multiplier_error": error}
        lines.append(
            f"At the point |µ| = {growth:.6f}, the growth of a disturbance from one period to "
            f"the next: {'stable' if growth < 1 else 'not stable'}."
        )
    simulated = structure.frf is not None and structure.frf.simulated
    name = ", ".join(filter(None, (asked.source.name, asked.pose)))
    more |= pictures.write(draw, name, LOBES, simulated=simulated)
    made = _table(cut, found, robust, "First loss of stability", "kind", kinds)
    return _answer(cut, found, robust, told, simulated, more, made, *map(Text, lines))


def _how_sure(drawn: lobes.SampledLimits) -> list[str]:
    off = drawn.robust_sd()
    off = off[np.isfinite(off)]
    if not off.size:
        return []
    return [
        f"Depths at {100 * lobes.PROBABILITY:.0f} % are from {len(drawn.depth_m)} samples, "
        f"known to ± {100 * np.median(off):.1f} % (median over speeds)."
    ]


def _answer(
    cut: Cut, losses: Sequence[lobes.StabilityLimit], robust_m: np.ndarray, told: Sequence[str],
    simulated: bool, more: Mapping[str, Any], *said: RenderableType,
) -> Done:  # fmt: skip
    """First losses of stability at each speed (n,) of a cut, and depths stable with 95 %, in m.

    Per speed the smallest depth that chatters, and how; null where every depth that was asked for
    is stable. `more` keys go with them.
    """
    keys = {
        "spindle_rpm": cut.speeds_rpm, "depth_limit_m": [one.depth_m for one in losses],
        "kind": [one.kind for one in losses], "chatter_hz": [one.chatter_hz for one in losses],
        "depth_limit_m_at_95": robust_m, "method": cut.method, "remarks": told,
        "simulated": simulated, **more,
    }  # fmt: skip
    return Done(keys, Group(*said, *remarks(told), *ending(keys)))


def _table(
    cut: Cut, losses: Sequence[lobes.StabilityLimit], robust_m: np.ndarray, title: str, last: str,
    cells: Sequence[str],
) -> Table:  # fmt: skip
    """Some of the speeds, and `cells` (n,) of a last column."""
    columns = "spindle (rpm)", "depth limit (mm)", "at 95 % (mm)", "chatter (Hz)"
    each = -(-len(cells) // MOST_ROWS)
    some = f", one of every {each} speeds (--json: all)" if each > 1 else ""
    made = table(f"{title}, {cut.method.replace('_', ' ')}{some}", *columns, last)
    # The speed at which least is stable is never one that is left out.
    least = int(np.argmin(np.where(np.isfinite(robust_m), robust_m, np.inf)))
    for i in sorted({*range(0, len(cells), each), least, len(cells) - 1}):
        depths = losses[i].depth_m, robust_m[i]
        made.add_row(
            f"{cut.speeds_rpm[i]:.0f}", *(depth_mm(depth, "–") for depth in depths),
            number(losses[i].chatter_hz, ".1f"), cells[i],
        )  # fmt: skip
    return made


def path_report(
    asked: cut_source.StabilityRequest, cut: Cut, pictures: Pictures, progress: ProgressCallback
) -> Done:
    """Answer of `stability` of every pose of an npz, or of a campaign along a path.

    "tightest_pose" is per speed (n,) the one that allows the least, "best_depth_m_at_95" what the
    whole path allows at "best_spindle_rpm".
    """
    travelled = toolpath_poses.path_poses(asked, cut) if asked.source.is_dir() else None
    if travelled is None and (asked.path or asked.origin or asked.turns):
        raise InputError(
            f"{asked.source} holds FRFs of certain poses; --path, --origin, --turns need a "
            f"campaign."
        )
    poses = travelled.structures(cut) if travelled else cut_source.structures_of_file(asked, cut)
    limits = limits_along(
        poses, cut, asked.samples, part_of(progress, 0, 0.5 if asked.turns else 1)
    )
    robust, at = np.min(limits.robust_m, axis=0), limits.best_speed
    rpm, depth, turn = float(cut.speeds_rpm[at]), float(robust[at]), None
    turned = limits_by_feed(poses, cut, rpm)
    feed = toolpath_poses.FeedAdvice(tuple(map(float, TURNS_DEG)), tuple(map(float, turned)))
    if travelled is not None:
        if asked.turns:
            turn = toolpath_poses.turn_advice(travelled, cut, rpm, part_of(progress, 0.5, 1.0))
        feed = replace(
            feed,
            direction_base=toolpath_poses.feed_in_base(travelled, cut, feed.turn_deg[feed.best]),
        )
    simulated = any(one.frf is not None and one.frf.simulated for _, one in poses)
    tightest = [limits.names[i] for i in limits.tightest]
    more = {
        "tightest_pose": tightest, "poses": limits.names, "best_spindle_rpm": rpm,
        "best_depth_m_at_95": depth, "feed": feed, "turn": turn,
        **pictures.write(
            lambda: _path_figures(limits, rpm, feed, turn, cut), asked.source.name, PATH,
            simulated=simulated,
        ),
    }  # fmt: skip
    losses = [limits.found[p][i] for i, p in enumerate(np.argmin(limits.depth_m, axis=0))]
    known = zip(tightest, losses, strict=True)
    cells = [pose if np.isfinite(loss.depth_m) else "–" for pose, loss in known]
    made = _table(cut, losses, robust, f"{len(poses)} poses", "tightest pose", cells)
    best = (
        f"Best speed for the whole path: {rpm:.0f} rpm allows {depth_mm(depth, EVERY, ' mm')} "
        f"with 95 % probability."
    )
    said = best, feed.text, turn.text(limits.names) if turn is not None else ""
    told = _of_poses(poses, limits, cut, travelled)
    best = Text(" ".join(filter(None, said)))
    return _answer(cut, losses, robust, told, simulated, more, made, best)


def _path_figures(
    limits: PathLimits, rpm: float, feed: toolpath_poses.FeedAdvice,
    turn: toolpath_poses.TurnAdvice | None, cut: Cut,
) -> dict[str, Any]:  # fmt: skip
    from planner.report.milling_plots import path_figure, turns_figure

    made = {"path": path_figure(limits, rpm, feed, cut)}
    if turn is not None:
        made["turns"] = turns_figure(turn, limits.names, rpm, cut.depth_m[1])
    return made


def _of_poses(
    poses: Sequence[tuple[str, Structure]], limits: PathLimits, cut: Cut,
    travelled: cut_source.CampaignPoses | None,
) -> list[str]:  # fmt: skip
    """What to mind of a campaign's path, and of each pose."""
    told: list[str] = []
    if travelled is not None:
        told += travelled.remarks(cut)
    told += [
        f"{name}: {text}" for (name, structure), row in zip(poses, limits.found, strict=True)
        if (text := out_of_band_remark(structure, np.array([loss.chatter_hz for loss in row])))
    ]  # fmt: skip
    rows = zip(poses, limits.depth_m, limits.known, strict=True)
    told += [
        f"{name}: {text}" for (name, structure), row, known in rows
        for text in limit_remarks(structure, cut, row, known)
    ]  # fmt: skip
    return told
