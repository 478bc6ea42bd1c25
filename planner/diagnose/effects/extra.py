"""Elastic rotations that the simulation lacks: what base and transverse compliance share."""

from dataclasses import dataclass, replace

import numpy as np

from planner.diagnose.effect import Effect
from planner.diagnose.effects.places import damping_time, with_blocks
from planner.identify.parameters import Priors, axis_name
from planner.physics.simulation import Simulation
from planner.robot.config import Compliance

DAMPING_FACTOR = 8.0


@dataclass(frozen=True)
class ExtraCompliance(Effect):
    """Rotations about `axes` of `joint`, each with a stiffness between `lower` and `upper`."""

    joint: str = ""
    axes: tuple[tuple[float, float, float], ...] = ()
    lower: float = 0.0
    upper: float = 0.0

    @property
    def _median(self) -> float:
        return float(np.sqrt(self.lower * self.upper))

    def structure(self, simulation: Simulation) -> Simulation:
        """With one more [[compliance]] block an axis."""
        damping = damping_time(simulation) * self._median
        blocks = [Compliance(self.joint, axis, self._median, damping) for axis in self.axes]
        return with_blocks(simulation, tuple(blocks))

    def priors(self, simulation: Simulation, priors: Priors) -> Priors:
        """Log-uniform ones of the new springs' stiffness and damping."""
        time = damping_time(simulation)
        bounds = dict(priors.bounds)
        for axis in self.axes:
            place = f"{self.joint} about {axis_name(axis)}"
            bounds[f"stiffness of {place}"] = (self.lower, self.upper)
            low, high = self.lower * time, self.upper * time
            bounds[f"damping of {place}"] = (low / DAMPING_FACTOR, high * DAMPING_FACTOR)
        return replace(priors, bounds=bounds)

    def springs(self, simulation: Simulation) -> tuple[str, ...]:
        """Stiffness and damping of each new rotation."""
        places = [f"{self.joint} about {axis_name(axis)}" for axis in self.axes]
        return tuple(f"{kind} of {p}" for p in places for kind in ("stiffness", "damping"))
