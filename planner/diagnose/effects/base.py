"""A floor, pedestal or anchor bolts that give: two tilts between floor and robot."""

from dataclasses import dataclass

import numpy as np

from planner.diagnose.effects.extra import ExtraCompliance
from planner.diagnose.effects.places import missing_axes
from planner.physics.simulation import Simulation
from planner.robot.robot import BASE

REACH = (0.3, 30.0)  # times the largest stiffness of the robot's joints


@dataclass(frozen=True)
class BaseCompliance(ExtraCompliance):
    """Tilts about the world's x and y through the URDF's origin."""

    name = "base_compliance"

    @classmethod
    def everywhere(cls, simulation: Simulation) -> tuple["BaseCompliance", ...]:
        """At the base, about the axes that robot.toml does not list there."""
        axes = missing_axes(simulation, BASE, np.eye(3)[:2])
        if not len(axes):
            return ()
        largest = max(b.stiffness for b in simulation.robot.config.compliance)
        low, high = (float(r * largest) for r in REACH)
        told = tuple((float(x), float(y), float(z)) for x, y, z in axes)
        return (cls("base", (), BASE, told, low, high),)

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        told = " and ".join(
            f"{v:.2g} ± {sd:.1g} {u}" for n, (v, sd, u) in values.items() if "stiffness" in n
        )
        return (
            f"The robot tilts on its base, with a stiffness of {told} about x and y: check the "
            f"anchor bolts and the pedestal."
        )
