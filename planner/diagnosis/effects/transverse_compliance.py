"""Bearings that give across a joint's own axis (Birk et al. 2025, section 2.2)."""

from dataclasses import dataclass

import numpy as np

from planner.diagnosis.effects.extra_compliance import ExtraCompliance, Give, across, told, triple
from planner.diagnosis.effects.places import joints, missing_axes, own_axis, stiffest
from planner.diagnosis.thresholds import ACROSS_STIFFNESS
from planner.dynamics.simulation import Simulation


@dataclass(frozen=True)
class TransverseCompliance(ExtraCompliance):
    """Tilts about two axes across the joint's own; of a carriage that slides about all three."""

    name = "transverse_compliance"

    @classmethod
    def everywhere(cls, simulation: Simulation) -> tuple["TransverseCompliance", ...]:
        """At every joint whose tilts robot.toml does not list."""
        found = []
        for place, joint in joints(simulation):
            axis, slides = own_axis(simulation, joint), simulation.robot.slides(joint)
            tilts = across(axis)
            # A carriage may roll about its rail, too.
            wanted = np.concatenate([tilts, axis[None]]) if slides else tilts
            axes = missing_axes(simulation, joint, wanted)
            if len(axes):
                low, high = (float(r * stiffest(simulation, joint)) for r in ACROSS_STIFFNESS)
                found.append(cls(place, (), joint, tuple(Give(triple(a), low, high) for a in axes)))
        return tuple(found)

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        return (
            f"{self.at} gives across its own axis, with a stiffness of {told(values)}: check its "
            f"bearing and bolts."
        )
