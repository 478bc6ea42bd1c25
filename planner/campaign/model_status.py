"""How sure a campaign's model is: of poses left out, and of the cut that campaign.toml names."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from planner.campaign.model import Model
    from planner.surrogate.leave_one_out import LeaveOneOut

NAMED = 6  # poses in a sentence


@dataclass(frozen=True)
class LeftOutFrequency:
    """A measured frequency beside its prediction without that pose.

    `sd_hz` holds the noise too; `below` is the share of the prediction below what was measured.
    """

    pose: str
    mode: int
    measured_hz: float
    predicted_hz: float
    sd_hz: float
    below: float


@dataclass(frozen=True)
class LeftOutValues:
    """All `values` left out one by one; `coverage` is their share in the intervals by level.

    `worst` are the poses off by most, for what was expected of them; `text` says all this.
    """

    values: int
    coverage: dict[str, float] | None
    worst: tuple[str, ...]
    frequencies: tuple[LeftOutFrequency, ...]
    text: tuple[str, ...]


def found_without(model: "Model") -> "tuple[LeaveOneOut, tuple[str, ...]]":
    """Errors of ln f (n, count), by the likelier of the two models of each mode; pose names."""
    from planner.surrogate.leave_one_out import leave_one_out

    found = leave_one_out(model.surrogate.primary.most_probable.outputs, len(model.labelled))
    return found, tuple(pose.pose for pose in model.labelled)


def left_out(model: "Model") -> LeftOutValues:
    """Of a campaign's model."""
    from planner.surrogate.leave_one_out import LEVELS, report

    found, poses = found_without(model)
    modes = tuple(f"the frequency of mode {k + 1}" for k in range(model.surrogate.count))
    values = int(np.isfinite(found.rank).sum()) if len(model.labelled) > 1 else 0
    said = tuple(report(found, poses, modes))
    if not values:
        return LeftOutValues(0, None, (), (), said)
    coverage = dict(zip(map(str, LEVELS), found.coverage().tolist(), strict=True))
    worst = tuple(poses[i] for i in found.worst().tolist())
    measured_hz = model.seen.frequency_hz  # by modal analysis, or by the simulation's own shapes
    predicted = measured_hz * np.exp(-found.error)
    numbers = measured_hz, predicted, predicted * found.sd, found.rank
    rows = tuple(
        LeftOutFrequency(poses[i], k + 1, *(float(values[i, k]) for values in numbers))
        for i, k in np.argwhere(np.isfinite(found.rank)).tolist()
    )
    return LeftOutValues(values, coverage, worst, rows, said)


@dataclass(frozen=True, eq=False)
class DecisionStatus:
    """How sure it is whether the cut of campaign.toml is stable, at each of the poses (u, dof).

    `measurements_left` until each answer is right with the probability of [stop]; None where so
    many cannot be foreseen: the cut is too near its limit somewhere.
    """

    speed_rpm: float
    depth_m: float
    joints_deg: np.ndarray
    stable_probability: np.ndarray
    sure: bool
    measurements_left: int | None
    probability: float

    @classmethod
    def of(cls, model: "Model") -> "DecisionStatus | None":
        """Of a campaign's model; None where campaign.toml names no cut."""
        table = model.cell.config.cut
        if not table or not model.labelled:
            return None
        from planner.campaign.decision import measurements_left

        decision = model.decision
        assert decision is not None
        probability = model.cell.config.stop.probability
        sure, q = decision.sure(probability), model.cell.robot.joints.shown(decision.q)
        return cls(
            table.speed_rpm, table.depth_m, q, decision.probability, sure,
            measurements_left(model), probability,
        )  # fmt: skip

    @property
    def text(self) -> str:
        """One or two sentences."""
        p = self.stable_probability
        least = int(np.argmin(np.abs(p - 0.5)))
        stable, not_stable = np.sum(p >= self.probability), np.sum(1 - p >= self.probability)
        at = f"{self.speed_rpm:g} rpm and {1e3 * self.depth_m:g} mm"
        said = (
            f"The cut at {at} is stable at {stable} of {len(p)} poses, not stable at "
            f"{not_stable}, undecided at {len(p) - stable - not_stable} (with "
            f"{100 * self.probability:g} % probability each); least sure is pose {least + 1}, "
            f"stable with {100 * p[least]:.0f} %. "
        )
        if self.sure:
            return said + "The decision is sure."
        if self.measurements_left is None:
            return said + "It is too near its limit there for a few measurements to make it sure."
        return said + f"About {self.measurements_left} more measured poses make it sure."


def outside_remark(names: Sequence[str]) -> str:
    """Sentence about the poses that lie outside; "" without any."""
    if not names:
        return ""
    lie = "lies" if len(names) == 1 else "lie"
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return (
        f"{', '.join(names[:NAMED])}{more} {lie} outside the workspace of campaign.toml: sds and "
        f"bands are not to be trusted there."
    )
