"""Bearings that give across a joint's own axis (seed 004, section 2.2)."""

from dataclasses import dataclass

import numpy as np

from planner.diagnose.effects.extra import ExtraCompliance
from planner.diagnose.effects.places import joints, missing_axes, own_axis, stiffest
from planner.physics.simulation import Simulation

REACH = (0.3, 30.0)  # times the joint's own stiffness


@dataclass(frozen=True)
class TransverseCompliance(ExtraCompliance):
    """Tilts about two axes across the joint's own."""

    name = "transverse_compliance"

    @classmethod
    def everywhere(cls, simulation: Simulation) -> tuple["TransverseCompliance", ...]:
        """At every joint whose tilts robot.toml does not list."""
        found = []
        for place, joint in joints(simulation):
            axis = own_axis(simulation, joint)
            first = int(np.argmin(np.abs(axis)))
            a = np.cross(axis, np.eye(3)[first])
            a /= np.linalg.norm(a)
            across = missing_axes(simulation, joint, np.array([a, np.cross(axis, a)]))
            if len(across):
                low, high = (float(r * stiffest(simulation, joint)) for r in REACH)
                told = tuple((float(x), float(y), float(z)) for x, y, z in across)
                found.append(cls(place, (), joint, told, low, high))
        return tuple(found)

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        told = " and ".join(
            f"{v:.2g} ± {sd:.1g} {u}" for n, (v, sd, u) in values.items() if "stiffness" in n
        )
        return f"{self.at} gives across its own axis ({told}): check its bearing and bolts."
