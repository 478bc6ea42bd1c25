"""Answer of `stability --map`: what a cut is allowed all over a campaign's workspace."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

from planner.campaign import cut_source
from planner.campaign.campaign import Campaign
from planner.errors import InputError
from planner.milling.cut import Cut
from planner.milling.path import best_speed_of, limits_along
from planner.milling.structure import OutOfBandError, Structure
from planner.progress import ProgressCallback, part_of
from planner.report.answer import Done
from planner.report.pictures import Pictures
from planner.report.stability import EVERY, depth_mm
from planner.report.text import ending, remarks, table

MOST_SPEEDS = 24  # among which the best for the whole workspace is looked for
MOST_ROWS = 10


def map_report(
    asked: cut_source.StabilityRequest,
    count: int,
    cut: Cut,
    pictures: Pictures,
    progress: ProgressCallback,
) -> Done:
    """Answer of `stability --map`: what each pose allows at the speed of the wanted point, or at
    the one at which the tightest pose allows the most.

    Depths in m, null where every depth asked for is stable; "depth_limit_m_at_95" with 95 %
    probability. "wanted_share": of the poses that allow the wanted depth with it, if one is named.
    "left_out": poses where the cut would chatter outside the FRFs' lines; they are in no list else.
    """
    campaign, kept, poses, left_out = _in_band(asked, count, cut)
    wanted, first = asked.wanted, part_of(progress, 0.0, 0.5)
    rpm = wanted[0] if wanted else best_speed_of(poses, cut, MOST_SPEEDS, first)
    limits = limits_along(poses, cut.at_speed(rpm), asked.samples, part_of(progress, 0.5, 1.0))
    robust, depth = limits.robust_m[:, 0], None if wanted is None else wanted[1]
    share = None if depth is None else float(np.mean(robust > depth))
    names, candidates = tuple(name for name, _ in poses), campaign.cell.candidates
    told = *cut_source.beyond_the_tip(campaign, cut), *_left_out(left_out, campaign.frequency_lines)
    position_m, features = candidates.position_m[kept], candidates.features[kept]

    def draw():
        from planner.report.milling_plots import map_figure

        where = position_m, features, campaign.cell.workspace.feature_names, robust
        return {"stability_map": map_figure(*where, rpm, depth, cut.depth_m[1])}

    note = f"At {rpm:.0f} rpm: poses by the depth stable with 95 %."
    simulated = campaign.state.simulated
    keys = {
        "spindle_rpm": rpm, "poses": names, "position_m": position_m,
        "joints_deg": campaign.cell.robot.joints.shown(candidates.q[kept]),
        "depth_limit_m": limits.depth_m[:, 0], "depth_limit_m_at_95": robust,
        "tightest_pose": names[int(np.argmin(robust))], "wanted_depth_m": depth,
        "wanted_share": share, "left_out": left_out, "remarks": told,
        "simulated": simulated, "joint_units": campaign.cell.robot.joints.declared,
        **pictures.write(draw, asked.source.name, note, simulated=simulated),
    }  # fmt: skip
    return Done(keys, Group(*_said(keys), *remarks(told), *ending(keys)))


def _in_band(
    asked: cut_source.StabilityRequest, count: int, cut: Cut
) -> tuple[Campaign, list[int], list[tuple[str, Structure]], tuple[str, ...]]:
    """Candidates where the cut chatters within the FRFs' lines, by number and name; the others.

    InputError where a file is asked, or a cut along a path.
    """
    if not asked.source.is_dir():
        raise InputError(f"{asked.source} knows no workspace; --map needs a campaign.")
    if cut.feed_in == "path":
        raise InputError(
            f'{asked.cut}: feed_in = "path" means nothing all over a workspace; state it in "base".'
        )
    change, campaign = cut_source.ToolChange.of(asked, cut), asked.campaign
    count = min(count, campaign.cell.spread)
    names, q = tuple(f"W{i + 1:03d}" for i in range(count)), campaign.cell.candidates.q[:count]
    at = list(cut_source.CampaignPoses(campaign, names, q, change).in_band(cut))
    kept = [i for i, s in enumerate(at) if isinstance(s, Structure)]
    if not kept:
        raise next(s for s in at if isinstance(s, OutOfBandError))
    poses = [(n, s) for n, s in zip(names, at, strict=True) if isinstance(s, Structure)]
    return campaign, kept, poses, tuple(name for i, name in enumerate(names) if i not in kept)


def _left_out(names: Sequence[str], lines_hz: np.ndarray) -> list[str]:
    if not names:
        return []
    return [
        f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} left out: the cut would "
        f"chatter there outside the {lines_hz[0]:g} to {lines_hz[-1]:g} Hz of the FRFs; widen "
        f"band_hz in campaign.toml and measure over the band of the modes that chatter."
    ]


def _said(keys: Mapping[str, Any]) -> tuple[Table, Text]:
    """The tightest poses, and what the whole workspace allows."""
    names, robust, wanted = keys["poses"], keys["depth_limit_m_at_95"], keys["wanted_depth_m"]
    made = table(
        f"Tightest of {len(names)} poses at {keys['spindle_rpm']:.0f} rpm",
        *("pose", "x, y, z (m)", "depth limit (mm)", "at 95 % (mm)"),
    )
    order = np.argsort(robust)
    for i in order[:MOST_ROWS]:
        place = ", ".join(f"{v:.3f}" for v in keys["position_m"][i])
        shown = keys["depth_limit_m"][i], robust[i]
        made.add_row(names[i], place, *(depth_mm(v, "–") for v in shown))
    low, high = (depth_mm(robust[order[k]], EVERY, " mm") for k in (0, -1))
    said = (
        f"With 95 % probability the workspace allows {low} at {keys['tightest_pose']} and "
        f"{high} at {names[order[-1]]}."
    )
    if wanted is not None:
        said += (
            f" {1e3 * wanted:g} mm is stable with that probability at "
            f"{100 * keys['wanted_share']:.0f} % of the poses."
        )
    return made, Text(said)
