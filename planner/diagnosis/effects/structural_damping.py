"""Structural damping, K(1 + iη), where the simulation has viscous dampers."""

from dataclasses import dataclass, replace

import msgspec
import numpy as np

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.thresholds import STRUCTURAL_SHARE
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import place_name
from planner.robot.config import Compliance
from planner.robot.robot import Robot


@dataclass(frozen=True)
class StructuralDamping(Effect):
    """Every damper becomes a loss factor that dissipates as much in the middle of the band."""

    name = "structural_damping"

    @classmethod
    def everywhere(cls, simulation: Simulation) -> tuple["StructuralDamping", ...]:
        """At all joints together, where robot.toml knows no loss factor."""
        blocks = simulation.robot.config.compliance
        known = any(b.loss_factor > 0 for b in blocks) or not any(b.damping > 0 for b in blocks)
        return () if known else (cls("joints"),)

    def structure(self, simulation: Simulation) -> Simulation:
        """The simulation with loss factors in the place of its dampers."""
        return _damped(simulation, viscous=0.0, structural=1.0)

    def springs(self, simulation: Simulation) -> tuple[str, ...]:
        """Names of the loss factors."""
        return tuple(
            f"loss_factor of {b.tie or place_name(b)}" for b in simulation.robot.config.compliance
        )

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        eta = [v for v, _, _ in values.values()]
        return (
            f"Damping does not grow with frequency: loss factors of {min(eta):.2g} to "
            f"{max(eta):.2g} describe it better than viscous dampers."
        )


def partly_structural(simulation: Simulation) -> Simulation:
    """The simulation with a loss factor beside each damper that has none.

    Gears, bearings and floors dissipate in both ways; how much in which nobody states, and it says
    nothing of what is wrong with the robot.
    """
    return _damped(simulation, viscous=1.0, structural=STRUCTURAL_SHARE)


def _damped(simulation: Simulation, viscous: float, structural: float) -> Simulation:
    """Shares of the dampers that stay, and that a loss factor takes mid-band."""
    robot: Robot = simulation.robot
    middle = 2 * np.pi * float(np.sqrt(np.prod(robot.config.band_hz)))

    def changed(b: Compliance) -> Compliance:
        if b.loss_factor or not b.damping:
            return b
        loss = min(1.0, structural * b.damping * middle / b.stiffness)
        return msgspec.structs.replace(b, damping=viscous * b.damping, loss_factor=loss)

    blocks = tuple(map(changed, robot.config.compliance))
    config = msgspec.structs.replace(robot.config, compliance=blocks)
    return Simulation(replace(robot, config=config))
