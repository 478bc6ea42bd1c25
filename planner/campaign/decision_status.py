"""How sure a campaign is of the cut that campaign.toml names."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import msgspec
import numpy as np

if TYPE_CHECKING:
    from planner.campaign.model import Model


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
        if table is msgspec.UNSET or not model.labelled:
            return None
        from planner.campaign.decision import measurements_left

        decision = model.decision
        if decision is None:
            return None
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
