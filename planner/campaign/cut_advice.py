"""What another feed or another turn of the robot about the tool would allow along a path."""

from dataclasses import dataclass

import msgspec
import numpy as np

from planner.campaign.toolpath_poses import TURNS_DEG, Travelled
from planner.milling.cut import Cut
from planner.milling.path import limit_at
from planner.progress import Tell, quietly

WORTH_PERCENT = 5.0  # more depth: less is not worth a change of the program


@dataclass(frozen=True)
class FeedAdvice:
    """What turning the feed about the tool's axis would allow at the best speed.

    Angles in degrees from the feed as it is towards axis × feed, depths in m that all poses allow.
    `direction_base` is the best feed in the robot's base frame, where that is one for all poses.
    """

    turn_deg: tuple[float, ...]
    depth_m: tuple[float, ...]
    direction_base: tuple[float, float, float] | None = None

    @property
    def best(self) -> int:
        """Number of the best angle."""
        return int(np.argmax(self.depth_m))

    @property
    def text(self) -> str:
        """One sentence."""
        if not np.isfinite(self.depth_m[0]):
            return ""
        gain = 100 * (self.depth_m[self.best] / self.depth_m[0] - 1)
        if not gain > WORTH_PERCENT:
            return "Another feed direction gains less than 5 % of depth."
        if not np.isfinite(gain):
            return f"Turned by {self.turn_deg[self.best]:g}° the feed allows every depth asked for."
        base = ""
        if self.direction_base is not None:
            base = (
                " (along [" + ", ".join(f"{v:.2f}" for v in self.direction_base) + "] of the base)"
            )
        return (
            f"Turned by {self.turn_deg[self.best]:g}° about the tool's axis{base}, the feed allows "
            f"{gain:.0f} % more depth."
        )


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
    # With the feeds as they are in the base frame, whatever the cut says.
    poses = travelled.standing(found).structures(msgspec.structs.replace(cut, feed_in="path"))
    for k, ((i, turn, _), (_, structure)) in enumerate(zip(found, poses, strict=True)):
        depth[i, int(np.argmin(np.abs(TURNS_DEG - turn)))] = limit_at(structure, cut, rpm)
        tell("turns", (k + 1) / len(found))
    return TurnAdvice.of(depth)
