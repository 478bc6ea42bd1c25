"""A load that changes in the course of the campaign: another tool, or something that fell off."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from planner.diagnosis.effects.added_mass import AddedMass
from planner.diagnosis.effects.effect import Setting
from planner.dynamics.gradient import Impedance, Terms
from planner.dynamics.simulation import Simulation

BESIDE = 0.5  # prior sds of its place, by which a load is begun beside the link's centre of mass


@dataclass(frozen=True)
class ChangedLoad(AddedMass):
    """What the last link carries more (or less) at some visits, the first of them of a pose."""

    carried: tuple[bool, ...] = ()
    since_pose: str = ""

    name = "drift"

    @classmethod
    def of_last_link(cls, simulation: Simulation, carried: np.ndarray, pose: str) -> Self | None:
        """At visits (n,) bool from one of a `pose` on; None where no link carries anything."""
        masses = AddedMass.everywhere(simulation)
        if not masses:
            return None
        last = masses[-1]
        return cls(last.at, last.quantities, last.joint, tuple(carried.tolist()), pose)

    def at_visits(self, carried: np.ndarray) -> "ChangedLoad":
        """The same at other visits (n,) bool."""
        return replace(self, carried=tuple(carried.tolist()))

    def starts(self) -> np.ndarray:
        """As of a mass, and the same beside the link's centre of mass, to all sides."""
        sides = np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
        begun = super().starts()
        away = [BESIDE * side * [q.sd for q in self.quantities[1:]] for side in sides]
        return np.array([start + np.append(0.0, d) for d in away for start in begun])

    def impedance(self, setting: Setting, psi: np.ndarray) -> tuple[Impedance, ...]:
        """That of a mass, at the visits that have it."""
        there = np.array(self.carried, dtype=float)[:, None]

        def some(terms: Terms) -> Terms:
            return tuple((number, coefficient * there) for number, coefficient in terms)

        return tuple(
            replace(one, values=some(one.values), slope=tuple(map(some, one.slope)))
            for one in super().impedance(setting, psi)
        )

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        mass, sd, _ = values["mass"]
        what = "more" if mass > 0 else "less"
        return (
            f"From the visit of {self.since_pose} on, {self.at} carries {abs(mass):.3g} ± {sd:.1g} "
            f"kg {what} than before: was the tool changed, or something left there or taken off?"
        )
