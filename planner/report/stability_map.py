"""Answer of `stability --map`: what a cut is allowed all over a campaign's workspace."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from rich.console import Group
from rich.text import Text

from planner.campaign.campaign import Campaign
from planner.campaign.cut_source import Asked, ToolChange, at_poses_in_band
from planner.errors import InputError
from planner.milling.cut import Cut
from planner.milling.path import at_speed, best_speed_of
from planner.milling.structure import OutOfBandError, Structure
from planner.progress import Tell, quietly, within
from planner.report.answer import Answer
from planner.report.plot_files import Pictures
from planner.report.text import SIMULATED, SIMULATED_TITLE, drawn, number, remarks, table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
            shown = (_mm(self.depth_limit_m[i]), _mm(self.depth_limit_m_at_95[i]))
            made.add_row(self.poses[i], place, *(number(v, ".4f") for v in shown))
        low, high = (_mm(self.depth_limit_m_at_95[order[k]]) for k in (0, -1))
        said = (
            f"With 95 % probability the workspace allows {number(low, '.3f')} mm at "
            f"{self.tightest_pose} and {number(high, '.3f')} mm at {self.poses[order[-1]]}."
        )
        if self.wanted_depth_m is not None and self.wanted_share is not None:
            said += (
                f" {1e3 * self.wanted_depth_m:g} mm is stable with that probability at "
                f"{100 * self.wanted_share:.0f} % of the poses."
            )
        parts = [made, Text(said), *remarks(self.remarks), *drawn(self.plots)]
        return Group(*parts, SIMULATED) if self.simulated else Group(*parts)


def _mm(depth_m: Any) -> float | None:
    return 1e3 * float(depth_m) if np.isfinite(depth_m) else None


def map_report(
    asked: Asked, count: int, cut: Cut, pictures: Pictures, tell: Tell = quietly
) -> MapReport:
    """At the speed of the wanted point, or the one at which the tightest pose allows the most."""
    if not asked.source.is_dir():
        raise InputError(f"{asked.source} knows no workspace; --map needs a campaign.")
    if cut.feed_in == "path":
        raise InputError(
            f'{asked.cut}: feed_in = "path" means nothing all over a workspace; state it in "base".'
        )
    change, campaign = ToolChange.of(asked, cut), asked.campaign
    candidates = campaign.cell.candidates
    count = min(count, campaign.cell.spread)
    asked_of = tuple(f"W{i + 1:03d}" for i in range(count))
    at = at_poses_in_band(campaign, asked_of, candidates.q[:count], cut, change)
    poses = [(n, s) for n, s in zip(asked_of, at, strict=True) if isinstance(s, Structure)]
    names = tuple(name for name, _ in poses)
    left_out = tuple(name for name in asked_of if name not in names)
    if not names:
        raise next(s for s in at if isinstance(s, OutOfBandError))
    kept = np.array([i for i, s in enumerate(at) if isinstance(s, Structure)])
    q = candidates.q[kept]
    wanted = asked.wanted
    rpm = wanted[0] if wanted else best_speed_of(poses, cut, MOST_SPEEDS, within(tell, 0.0, 0.5))
    found, robust = at_speed(poses, cut, rpm, asked.samples, within(tell, 0.5, 1.0))
    share = None if wanted is None else float(np.mean(robust > wanted[1]))
    joints = campaign.cell.robot.joints
    answer = MapReport(
        rpm, names, joints.shown(q), candidates.position_m[kept], found, robust,
        names[int(np.argmin(robust))],
        wanted_depth_m=wanted[1] if wanted else None,
        wanted_share=share,
        left_out=left_out,
        remarks=_left_out(left_out, campaign.frequency_lines),
        simulated=campaign.state.simulated,
        joint_units=joints.declared,
    )  # fmt: skip
    if not pictures.wanted:
        return answer
    coordinates = _coordinates(campaign)
    features = candidates.features[kept]
    figure = _figure(answer, features, coordinates, cut)
    mark = SIMULATED_TITLE if answer.simulated else ""
    note = f"{mark}At {answer.spindle_rpm:.0f} rpm: poses by the depth stable with 95 %."
    written = pictures.write({"stability_map": figure}, asked.source.name, note)
    return replace(answer, plots=tuple(written["plots"]), rrd=written["rrd"])


def _left_out(names: tuple[str, ...], lines: np.ndarray) -> tuple[str, ...]:
    if not names:
        return ()
    one = len(names) == 1
    return (
        f"{', '.join(names)} {'is' if one else 'are'} left out: the cut would chatter there "
        f"outside the {lines[0]:g} to {lines[-1]:g} Hz of the FRFs; widen band_hz in "
        f"campaign.toml and measure over the band of the modes that chatter.",
    )


def _coordinates(campaign: Campaign) -> tuple[str, ...]:
    return campaign.cell.workspace.feature_names


def _figure(answer: MapReport, features: np.ndarray, names: tuple[str, ...], cut: Cut) -> "Figure":
    """From above and from the side, and over what of the pose the limit hangs on most."""
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 4.6), layout="constrained")
    panels = figure.subplots(1, 3)
    top = 1e3 * cut.depth_m[1]
    shown = np.minimum(1e3 * answer.depth_limit_m_at_95, top)
    x, y, z = answer.position_m.T
    tight = int(np.argmin(shown))
    for panel, (a, b, labels) in zip(
        panels, ((x, y, ("x (m)", "y (m)")), (x, z, ("x (m)", "z (m)"))), strict=False
    ):
        panel.scatter(
            a, b, c=shown, cmap="viridis", norm=LogNorm(), s=45, edgecolor="black", lw=0.3
        )
        panel.plot(a[tight], b[tight], "o", mfc="none", mec="tab:red", ms=13, mew=1.8)
        panel.set_xlabel(labels[0])
        panel.set_ylabel(labels[1])
        panel.set_aspect("equal", "datalim")
    most = _most(features, shown)
    panels[2].plot(features[:, most], shown, "o", ms=5)
    panels[2].plot(
        features[tight, most], shown[tight], "o", mfc="none", mec="tab:red", ms=13, mew=1.8
    )
    panels[2].set_xlabel(f"{names[most]}, share of its range")
    panels[2].set_yscale("log")
    panels[2].set_ylabel("depth stable with 95 % (mm)")
    if answer.wanted_depth_m is not None:
        panels[2].axhline(1e3 * answer.wanted_depth_m, color="tab:red", ls="--", lw=1)
    for panel in panels:
        panel.grid(True, alpha=0.3)
    figure.colorbar(
        panels[0].collections[0], ax=panels[:2], label="depth stable with 95 % probability (mm)"
    )
    mark = SIMULATED_TITLE if answer.simulated else ""
    figure.suptitle(
        f"{mark}What {len(shown)} poses of the workspace allow at {answer.spindle_rpm:.0f} rpm "
        f"(ring: the tightest)", fontsize=11,
    )  # fmt: skip
    return figure


def _most(features: np.ndarray, depth: np.ndarray) -> int:
    """Which of the features (n, d) the depth (n,) hangs on most."""
    return int(np.argmax([abs(_rank_correlation(column, depth)) for column in features.T]))


def _rank_correlation(a: np.ndarray, b: np.ndarray) -> float:
    first, second = (np.argsort(np.argsort(v)) - (len(v) - 1) / 2 for v in (a, b))
    return float(first @ second / np.linalg.norm(first) / np.linalg.norm(second))
