"""Drift: stiffness that changes in the course of the campaign, whatever the pose.

All springs are multiplied by e^ψ(order), order being 0 at the first visit and 1 at the last; or
those of some joints about their own axes, each by its own ψ, all with one course.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.diagnosis.effects.effect import Effect, Quantity
from planner.diagnosis.effects.places import joint_of, joints
from planner.diagnosis.thresholds import DRIFT_BEND_SD, DRIFT_LOG_SD
from planner.dynamics.simulation import Simulation

CHANGE = Quantity("change", "1", 0.0, DRIFT_LOG_SD)
BEND = Quantity("bend", "1", 0.0, DRIFT_BEND_SD)


@dataclass(frozen=True)
class Drift(Effect):
    """ψ(order) of one kind: "gradual" (change at the end, bend), "step" (change from `since` on),
    "free" (a change of each visit).

    All but "free" may be of single `joints`, each by its own change; a gradual one has one bend.
    """

    kind: str = "gradual"
    since: float = 0.5
    joints: tuple[str, ...] = ()

    name = "drift"

    @classmethod
    def of_all(cls) -> "Drift":
        """Gradual, of all springs together."""
        return cls("campaign", (CHANGE, BEND))

    @classmethod
    def at_once(cls, since: float) -> "Drift":
        """Of all springs together, from `since` on."""
        return cls("campaign", (CHANGE,), "step", since)

    def of_joints(self, chosen: Sequence[str]) -> "Drift":
        """The same course, each of these joints ("joint_1" and so on) by its own change."""
        own = tuple(Quantity(change_of(joint), "1", 0.0, DRIFT_LOG_SD) for joint in chosen)
        bend = (BEND,) if self.kind == "gradual" else ()
        return replace(self, quantities=(*own, *bend), joints=tuple(chosen))

    def of_each(self, simulation: Simulation) -> "Drift":
        """As `of_joints`, of all that have a spring of their own."""
        robot = simulation.robot
        sprung = {block.joint for block in robot.config.compliance if robot.is_own(block)}
        return self.of_joints([place for place, name in joints(simulation) if name in sprung])

    def members(self, simulation: Simulation) -> np.ndarray:
        """(e, g) of 0 and 1: which elastic degrees of freedom go with which of g factors."""
        robot = simulation.robot
        blocks = robot.config.compliance
        if not self.joints:
            return np.ones((len(blocks), 1))
        own = [block.joint if robot.is_own(block) else None for block in blocks]
        there = [joint_of(simulation, joint) for joint in self.joints]
        return np.array([[float(joint == name) for name in there] for joint in own])

    def log_factor(self, order: np.ndarray, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """ψ(order) (n, g) of each factor, and its derivatives (n, p, g)."""
        if self.kind == "step":
            after = (order >= self.since).astype(float)
            slope = np.einsum("n,gh->ngh", after, np.eye(len(psi)))
            return after[:, None] * psi, slope
        if self.kind == "free":
            slope = np.vstack([np.zeros(len(psi)), np.eye(len(psi))])
            return np.append(0.0, psi)[:, None], slope[:, :, None]
        shape, bent = _bent(order, psi[-1])
        along = np.einsum("n,gh->ngh", shape, np.eye(len(psi) - 1))
        slope = np.concatenate([along, (bent[:, None] * psi[:-1])[:, None]], axis=1)
        return shape[:, None] * psi[:-1], slope

    def starts(self) -> np.ndarray:
        """See `Effect.starts`."""
        if self.kind == "gradual" and not self.joints:
            return np.array([[0.5 * DRIFT_LOG_SD, 0.0], [-0.5 * DRIFT_LOG_SD, 0.0]])
        return np.array([[q.mean for q in self.quantities]])

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""

        def told(name: str) -> str:
            size, sd, _ = values[name]
            return f"{100 * size:.3g} ± {100 * sd:.1g} %"

        how = "at once" if self.kind == "step" else "bit by bit"
        each = [f"{j} by {told(change_of(j))}" for j in self.joints]
        sizes = ", ".join(each) or f"all springs by {told('change')}"
        return (
            f"Stiffness changes in the course of the campaign, {how}: {sizes}. Let the robot warm "
            "up, and return to a pose to check."
        )


def change_of(joint: str) -> str:
    """Name of the parameter of a joint's own change."""
    return f"change of {joint}"


def _bent(order: np.ndarray, bend: float) -> tuple[np.ndarray, np.ndarray]:
    """(1 − e^(−κo)) / (1 − e^(−κ)) and its derivative with respect to κ."""
    if abs(bend) < 1e-4:
        return order + bend * order * (1 - order) / 2, order * (1 - order) / 2
    up, down = -np.expm1(-bend * order), -np.expm1(-bend)
    rise = order * np.exp(-bend * order)
    return up / down, rise / down - up * np.exp(-bend) / down**2
