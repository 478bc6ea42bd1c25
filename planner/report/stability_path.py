"""Answer of `stability` along a path: the tightest pose, the best speed, the better feed."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Group
from rich.text import Text

from planner.campaign.cut_advice import FeedAdvice, TurnAdvice, turn_advice
from planner.campaign.cut_source import Asked, outside, structures_of_file
from planner.campaign.toolpath_poses import Travelled, Way
from planner.milling.cut import Cut
from planner.milling.path import TURNS_DEG, PathLimits, along, by_feed
from planner.milling.structure import Structure, beyond, doubts
from planner.progress import Tell, quietly, within
from planner.report.answer import Answer
from planner.report.plot_files import Pictures
from planner.report.text import SIMULATED, SIMULATED_TITLE, drawn, number, remarks, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_ROWS = 24


@dataclass(frozen=True, eq=False)
class PathReport(Answer):
    """Answer of `stability` along a path, per speed (n,) the pose that allows the least.

    Depths are null where all poses are stable up to the largest depth. `best_depth_m_at_95` is
    what the whole path allows at `best_spindle_rpm`.
    """

    spindle_rpm: np.ndarray
    depth_limit_m: np.ndarray
    kind: tuple[str | None, ...]
    chatter_hz: np.ndarray
    depth_limit_m_at_95: np.ndarray
    tightest_pose: tuple[str, ...]
    poses: tuple[str, ...]
    best_spindle_rpm: float
    best_depth_m_at_95: float
    feed: FeedAdvice
    method: str
    turn: TurnAdvice | None = None
    remarks: tuple[str, ...] = ()
    simulated: bool = False
    plots: tuple[str, ...] = ()
    rrd: str | None = None

    def text(self) -> Group:
        """A table of speeds, then the best of them."""
        made = table(
            f"{len(self.poses)} poses, {self.method.replace('_', ' ')}",
            *("spindle (rpm)", "depth limit (mm)", "at 95 % (mm)", "chatter (Hz)", "tightest pose"),
        )
        for i in range(0, len(self.spindle_rpm), max(1, -(-len(self.spindle_rpm) // MOST_ROWS))):
            made.add_row(
                f"{self.spindle_rpm[i]:.0f}",
                number(_or_none(1e3 * self.depth_limit_m[i]), ".4f"),
                number(_or_none(1e3 * self.depth_limit_m_at_95[i]), ".4f"),
                number(self.chatter_hz[i], ".1f"),
                self.tightest_pose[i],
            )
        deep = 1e3 * self.best_depth_m_at_95
        best = f"{deep:.3f} mm" if np.isfinite(deep) else "every depth that was asked for"
        said = (
            f"Best speed for the whole path: {self.best_spindle_rpm:.0f} rpm allows {best} with "
            f"95 % probability. {self.feed.text}"
        )
        if self.turn is not None:
            said += " " + self.turn.text(self.poses)
        parts = [made, Text(said), *remarks(self.remarks), *drawn(self.plots)]
        return Group(*parts, SIMULATED) if self.simulated else Group(*parts)


def _or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def path_report(
    asked: Asked, way: Way, cut: Cut, pictures: Pictures, tell: Tell = quietly
) -> PathReport:
    """Of every pose of an npz, or of a campaign along a way."""
    spent = (0.0, 0.5) if way.turns else (0.0, 1.0)
    if not asked.source.is_dir():
        way.check_none(asked.source)
        poses = structures_of_file(asked, cut)
        limits = along(poses, cut, asked.samples, tell)
        answer = _answer(poses, limits, cut)
    else:
        travelled = Travelled.of(asked, way, cut)
        poses = travelled.structures(cut)
        limits = along(poses, cut, asked.samples, within(tell, *spent))
        answer = _answer(poses, limits, cut)
        if way.turns:
            turned = turn_advice(travelled, cut, answer.best_spindle_rpm, within(tell, 0.5, 1.0))
            answer = replace(answer, turn=turned)
        feed = travelled.feed_in_base(answer.feed.turn_deg[answer.feed.best])
        said = *outside(travelled.campaign, travelled.names, travelled.q), *answer.remarks
        answer = replace(answer, feed=replace(answer.feed, direction_base=feed), remarks=said)
    if not pictures.wanted:
        return answer
    mark = SIMULATED_TITLE if answer.simulated else ""
    figures = {"path": _figure(limits, answer, cut, mark)}
    if answer.turn is not None:
        figures["turns"] = turns_figure(
            answer.turn, answer.poses, answer.best_spindle_rpm, mark, cut.depth_m[1]
        )
    note = f"{mark}Depths that are stable with 95 % probability at all poses, and at each."
    written = pictures.write(figures, asked.source.name, note)
    return replace(answer, plots=tuple(written["plots"]), rrd=written["rrd"])


def _answer(poses: list[tuple[str, Structure]], limits: PathLimits, cut: Cut) -> PathReport:
    first, depth = np.argmin(limits.depth_m, axis=0), np.min(limits.depth_m, axis=0)
    tightest = [limits.found[p][i] for i, p in enumerate(first)]
    robust, best = np.min(limits.robust_m, axis=0), limits.best_speed
    rpm = cut.speeds_rpm
    said = [
        f"{name}: {text}" for (name, structure), row in zip(poses, limits.found, strict=True)
        if (text := beyond(structure, np.array([loss.chatter_hz for loss in row])))
    ]  # fmt: skip
    rows = zip(poses, limits.depth_m, limits.known, strict=True)
    said += [
        f"{name}: {text}" for (name, structure), row, known in rows
        for text in doubts(structure, cut, row, known)
    ]  # fmt: skip
    turned = by_feed(poses, cut, float(rpm[best]))
    return PathReport(
        spindle_rpm=rpm,
        depth_limit_m=depth,
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


def _figure(limits: PathLimits, answer: PathReport, cut: Cut, mark: str) -> "Figure":
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 6.5), layout="constrained")
    upper, lower = figure.subplots(2, 1, height_ratios=(3, 1))
    rpm, top = cut.speeds_rpm, 1e3 * cut.depth_m[1]
    robust = np.minimum(1e3 * limits.robust_m, 2 * top)
    for row in robust:
        upper.plot(rpm, row, color="grey", lw=0.7, alpha=0.7)
    least = np.min(robust, axis=0)
    upper.fill_between(rpm, 0, least, color="#dcefd9", lw=0)
    upper.plot(rpm, least, color="tab:green", lw=2, label="whole path, 95 % probability")
    upper.axvline(answer.best_spindle_rpm, color="tab:red", lw=1, ls="--", label="best speed")
    upper.set_ylim(0, min(top, 1.25 * float(np.max(np.where(robust > top, 0, robust))) or top))
    upper.set_xlabel("spindle speed (rpm)")
    upper.set_ylabel("axial depth (mm)")
    upper.set_title(f"{mark}Stability along {len(limits.names)} poses (grey: each)", fontsize=11)
    upper.legend(fontsize=9, loc="upper left")
    lower.plot(answer.feed.turn_deg, 1e3 * np.array(answer.feed.depth_m), ".-")
    lower.set_ylim(bottom=0)
    lower.set_xlabel("feed turned about the tool's axis (°)")
    lower.set_ylabel("depth (mm)")
    for panel in (upper, lower):
        panel.grid(True, alpha=0.3)
    return figure


def turns_figure(
    advice: TurnAdvice, poses: tuple[str, ...], rpm: float, mark: str, deepest_m: float
) -> "Figure":
    """Depth over poses and angles."""
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 4.8), layout="constrained")
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
    panel.set_title(
        f"{mark}Depth limit at {rpm:.0f} rpm (ring: best of a pose, dashed: best for all, "
        f"grey: cannot stand)", fontsize=10,
    )  # fmt: skip
    figure.colorbar(image, ax=panel, label="depth limit (mm)")
    return figure
