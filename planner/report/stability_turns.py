"""How far a turn about the tool's axis, which milling leaves free, deepens a cut, pose by pose."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from planner.milling.cut import Cut
from planner.milling.path import limit_at
from planner.progress import Tell, quietly
from planner.report.path_poses import TURNS_DEG, Travelled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WORTH_PERCENT = 5.0  # more depth from another turn: less is not worth a change of the program


@dataclass(frozen=True)
class TurnAdvice:
    """What each pose allows by angle about the tool, at one speed, without uncertainty.

    `depth_m[pose][angle]` in m is null where the robot cannot stand so, and where every depth asked
    for is stable; `best_deg` by pose, `common_deg` the angle that suits all poses best.
    """

    turn_deg: tuple[float, ...]
    depth_m: tuple[tuple[float, ...], ...]
    reached: tuple[tuple[bool, ...], ...]
    best_deg: tuple[float, ...]
    common_deg: float

    @classmethod
    def of(cls, depth: np.ndarray) -> "TurnAdvice":
        """From depths (p, angles) in m, NaN where it cannot stand, inf where none is lost."""
        known = np.where(np.isnan(depth), -1.0, depth)
        tightest = known.min(axis=0)
        rows = tuple(tuple(float(v) for v in row) for row in depth)
        return cls(
            tuple(map(float, TURNS_DEG)), rows,
            tuple(tuple(bool(v) for v in row) for row in ~np.isnan(depth)),
            tuple(float(TURNS_DEG[i]) for i in known.argmax(axis=1)),
            float(TURNS_DEG[int(tightest.argmax())]),
        )  # fmt: skip

    def text(self, poses: tuple[str, ...]) -> str:
        """Sentences."""
        depth = np.array(self.depth_m)
        now, common = (
            float(np.min(depth[:, self.turn_deg.index(a)])) for a in (0.0, self.common_deg)
        )
        best = float(np.min(np.nanmax(depth, axis=1)))
        if not best > now * (1 + WORTH_PERCENT / 100):
            return "Turning the robot about the tool's axis gains less than 5 % of depth."
        said = (
            f"Turned about the tool's axis by {self.common_deg:g}° at all poses the robot allows "
        )
        if self.common_deg == 0:
            said = "No one turn about the tool's axis suits all poses better; as it is they allow "
        said += f"{1e3 * common:.3f} mm (now {1e3 * now:.3f})"
        each = ", ".join(f"{n} {a:g}°" for n, a in zip(poses[:6], self.best_deg, strict=False))
        more = ", …" if len(poses) > 6 else ""
        return f"{said}; each pose at its own best angle ({each}{more}) {1e3 * best:.3f} mm."


def turn_advice(travelled: Travelled, cut: Cut, rpm: float, tell: Tell = quietly) -> TurnAdvice:
    """At a speed in rpm, of each pose and angle."""
    found = [(i, turn, q) for i in range(len(travelled.q)) for turn, q in travelled.turned(i)]
    depth = np.full((len(travelled.q), len(TURNS_DEG)), np.nan)
    poses = travelled.standing(found).structures_with_feed(cut)
    for k, ((i, turn, _), (_, structure)) in enumerate(zip(found, poses, strict=True)):
        depth[i, int(np.argmin(np.abs(TURNS_DEG - turn)))] = limit_at(structure, cut, rpm)
        tell("turns", (k + 1) / len(found))
    return TurnAdvice.of(depth)


def turns_figure(advice: TurnAdvice, poses: tuple[str, ...], rpm: float, mark: str) -> "Figure":
    """Depth over poses and angles."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 4.8), layout="constrained")
    FigureCanvasAgg(figure)
    panel = figure.subplots()
    depth = 1e3 * np.array(advice.depth_m)
    shown = np.ma.masked_invalid(depth.T)
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
