"""Answer of `stability --map`: what a cut is allowed all over a campaign's workspace."""

from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
from rich.console import Group
from rich.text import Text

from planner.campaign import cut_source
from planner.errors import InputError
from planner.milling.cut import Cut
from planner.milling.path import best_speed_of, limits_along
from planner.milling.structure import OutOfBandError, Structure
from planner.progress import ProgressCallback, part_of
from planner.report.answer import Answer
from planner.report.pictures import Pictures
from planner.report.stability import EVERY, depth_mm
from planner.report.text import remarks, table

MOST_SPEEDS = 24  # among which the best for the whole workspace is looked for
MOST_ROWS = 10


@dataclass(frozen=True, eq=False)
class MapReport(Answer):
    """Answer of `stability --map`: at one speed, what each of n poses of the workspace allows.

    Depths in m, null where every depth asked for is stable; `depth_limit_m_at_95` with 95 %
    probability. `wanted_share`: of the poses that allow the wanted depth with it, if one is named.
    `left_out`: poses where the cut would chatter outside the FRFs' lines; they are in no list else.
    """

    spindle_rpm: float
    poses: tuple[str, ...]
    joints_deg: np.ndarray
    position_m: np.ndarray
    depth_limit_m: np.ndarray
    depth_limit_m_at_95: np.ndarray
    tightest_pose: str
    wanted_depth_m: float | None = None
    wanted_share: float | None = None
    left_out: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    simulated: bool = False
    plots: tuple[str, ...] = ()
    rrd: str | None = None
    joint_units: Any = msgspec.UNSET

    def text(self) -> Group:
        """The tightest poses, then what the whole workspace allows."""
        made = table(
            f"Tightest of {len(self.poses)} poses at {self.spindle_rpm:.0f} rpm",
            *("pose", "x, y, z (m)", "depth limit (mm)", "at 95 % (mm)"),
        )
        order = np.argsort(self.depth_limit_m_at_95)
        for i in order[:MOST_ROWS]:
            place = ", ".join(f"{v:.3f}" for v in self.position_m[i])
            shown = self.depth_limit_m[i], self.depth_limit_m_at_95[i]
            made.add_row(self.poses[i], place, *(depth_mm(v, "–") for v in shown))
        low, high = (depth_mm(self.depth_limit_m_at_95[order[k]], EVERY, " mm") for k in (0, -1))
        said = (
            f"With 95 % probability the workspace allows {low} at {self.tightest_pose} and "
            f"{high} at {self.poses[order[-1]]}."
        )
        if self.wanted_depth_m is not None and self.wanted_share is not None:
            said += (
                f" {1e3 * self.wanted_depth_m:g} mm is stable with that probability at "
                f"{100 * self.wanted_share:.0f} % of the poses."
            )
        return Group(made, Text(said), *remarks(self.remarks), *self.end)


def map_report(
    asked: cut_source.StabilityRequest,
    count: int,
    cut: Cut,
    pictures: Pictures,
    progress: ProgressCallback,
) -> MapReport:
    """At the speed of the wanted point, or the one at which the tightest pose allows the most."""
    if not asked.source.is_dir():
        raise InputError(f"{asked.source} knows no workspace; --map needs a campaign.")
    if cut.feed_in == "path":
        raise InputError(
            f'{asked.cut}: feed_in = "path" means nothing all over a workspace; state it in "base".'
        )
    change, campaign = cut_source.ToolChange.of(asked, cut), asked.campaign
    candidates = campaign.cell.candidates
    count = min(count, campaign.cell.spread)
    asked_of = tuple(f"W{i + 1:03d}" for i in range(count))
    at = list(cut_source.at_poses_in_band(campaign, asked_of, candidates.q[:count], cut, change))
    poses = [(n, s) for n, s in zip(asked_of, at, strict=True) if isinstance(s, Structure)]
    names = tuple(name for name, _ in poses)
    left_out = tuple(name for name in asked_of if name not in names)
    if not names:
        raise next(s for s in at if isinstance(s, OutOfBandError))
    kept = np.array([i for i, s in enumerate(at) if isinstance(s, Structure)])
    q = candidates.q[kept]
    wanted, first = asked.wanted, part_of(progress, 0.0, 0.5)
    rpm = wanted[0] if wanted else best_speed_of(poses, cut, MOST_SPEEDS, first)
    limits = limits_along(poses, cut.at_speed(rpm), asked.samples, part_of(progress, 0.5, 1.0))
    robust = limits.robust_m[:, 0]
    share = None if wanted is None else float(np.mean(robust > wanted[1]))
    low, *_, high = campaign.frequency_lines
    told = (
        f"{', '.join(left_out)} {'is' if len(left_out) == 1 else 'are'} left out: the cut would "
        f"chatter there outside the {low:g} to {high:g} Hz of the FRFs; widen band_hz in "
        f"campaign.toml and measure over the band of the modes that chatter."
    )
    joints = campaign.cell.robot.joints
    answer = MapReport(
        rpm, names, joints.shown(q), candidates.position_m[kept], limits.depth_m[:, 0], robust,
        names[int(np.argmin(robust))],
        wanted_depth_m=wanted[1] if wanted else None,
        wanted_share=share,
        left_out=left_out,
        remarks=(*cut_source.beyond_the_tip(campaign, cut), *((told,) if left_out else ())),
        simulated=campaign.state.simulated,
        joint_units=joints.declared,
    )  # fmt: skip

    def figures():
        from planner.report.milling_plots import map_figure

        names = campaign.cell.workspace.feature_names
        where = answer.position_m, candidates.features[kept], names, robust
        return {"stability_map": map_figure(*where, rpm, answer.wanted_depth_m, cut.depth_m[1])}

    note = f"At {rpm:.0f} rpm: poses by the depth stable with 95 %."
    return answer.with_figures(pictures, figures, asked.source.name, note)
