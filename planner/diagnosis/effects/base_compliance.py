"""A floor, pedestal or anchor bolts that give: tilts between floor and robot, or all six."""

from dataclasses import dataclass

import numpy as np

from planner.diagnosis.effects.added_mass import link_size
from planner.diagnosis.effects.extra_compliance import ExtraCompliance, Give, told, triple
from planner.diagnosis.effects.places import missing_axes
from planner.diagnosis.thresholds import BASE_STIFFNESS
from planner.dynamics.simulation import Simulation
from planner.robot.config import BASE


@dataclass(frozen=True)
class BaseCompliance(ExtraCompliance):
    """Tilts about the world's x and y through the URDF's origin; with them, maybe, the rest."""

    name = "base_compliance"

    @classmethod
    def everywhere(cls, simulation: Simulation) -> tuple["BaseCompliance", ...]:
        """At the base, about the axes that robot.toml does not list there."""
        axes = missing_axes(simulation, BASE, np.eye(3))
        tilts = [a for a in axes if abs(a[2]) < 0.5]
        if not tilts:
            return ()
        low, high = (r * _largest(simulation) for r in BASE_STIFFNESS)
        two = tuple(Give(triple(a), low, high) for a in tilts)
        found = [cls("base", (), BASE, two)]
        if len(axes) == 3:
            lever = link_size(simulation) ** 2
            shifts = tuple(Give(triple(a), low / lever, high / lever, True) for a in np.eye(3))
            turn = Give(triple(axes[2]), low, high)
            every = cls("base", (), BASE, (*two, turn, *shifts))
            found.append(every._movable(simulation))
        return tuple(found)

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        return (
            f"The robot moves on its base, which has a stiffness of {told(values)}: check the "
            f"anchor bolts and the pedestal."
        )


def _largest(simulation: Simulation) -> float:
    """Of the stiffnesses about the joints' own axes, roughly: the median of the largest three."""
    sizes = sorted(simulation.robot.turning_stiffness())
    return float(np.median(sizes[-3:]))
