"""A joint's stiffness that changes with its angle: gear contact, gravity compensator."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from planner.diagnosis.effects.effect import Effect, Quantity, Setting
from planner.diagnosis.effects.places import joint_of, joints
from planner.diagnosis.thresholds import ANGLE_DEPENDENCE_SD
from planner.dynamics.gradient import Impedance
from planner.dynamics.simulation import Simulation

ORDERS = (1, 2)  # a turn: out of balance, or like the teeth of two halves


@dataclass(frozen=True)
class AngleDependentStiffness(Effect):
    """K(q) = K₀ + a cos nq + b sin nq of the rotation about the joint's own axis, n = order."""

    order: int = 1

    name = "angle_dependent_stiffness"

    @classmethod
    def everywhere(cls, simulation: Simulation) -> tuple["AngleDependentStiffness", ...]:
        """At every joint that has a spring about its own axis."""
        found = []
        for place, joint in joints(simulation):
            number = _block(simulation, joint)
            if number is not None:
                k = float(simulation.elasticity.stiffness[number])
                waves = [
                    Quantity(w, "N·m/rad", 0.0, ANGLE_DEPENDENCE_SD * k) for w in ("cosine", "sine")
                ]
                quantities = (*waves, Quantity("damping_share", "1", 1.0, 0.5))
                found += [cls(place, quantities, order) for order in ORDERS]
        return tuple(found)

    def impedance(self, setting: Setting, psi: np.ndarray) -> tuple[Impedance, ...]:
        """On the diagonal, one value a pose; `damping_share` of the damping changes alike."""
        simulation = setting.simulation
        joint = joint_of(simulation, self.at)
        number = _block(simulation, joint)
        assert number is not None
        angle = self.order * setting.q[:, simulation.robot.joint_names.index(joint)]
        waves = np.stack([np.cos(angle), np.sin(angle)], axis=1)  # (n, 2)
        block = simulation.robot.config.compliance[number]
        late = setting.s * block.damping / block.stiffness  # (n, F)
        own = np.empty((len(angle), 3, setting.s.shape[1]), dtype=complex)
        own[:, :2] = waves[:, :, None] * (1 + psi[2] * late)[:, None]
        own[:, 2] = (waves @ psi[:2])[:, None] * late
        change = np.einsum("p,npf->nf", psi[:2], own[:, :2])
        port = np.zeros((len(angle), 1, simulation.elastic.size))
        port[:, 0, number] = 1.0
        slope = tuple(((0, own[:, k]),) for k in range(3))
        return (Impedance(port, np.ones((1, 1, 1)), ((0, change),), slope),)

    def elements(
        self, simulation: Simulation, values: dict[str, tuple[float, float, str]]
    ) -> dict[str, list[dict[str, Any]]]:
        """See `Effect.elements`."""
        block = {
            "joint": joint_of(simulation, self.at),
            "order": self.order,
            "cosine": values["cosine"][0],
            "sine": values["sine"][0],
        }
        return {"harmonic": [block]}

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        size = float(np.hypot(values["cosine"][0], values["sine"][0]))
        times = {1: "once", 2: "twice"}[self.order]
        return (
            f"The stiffness of {self.at} changes with its angle, {times} a turn, by ± {size:.2g} "
            f"N·m/rad: check gear, gravity compensator and cables."
        )


def _block(simulation: Simulation, joint: str) -> int | None:
    robot = simulation.robot
    for number, block in enumerate(robot.config.compliance):
        if block.joint == joint and robot.is_own(block) and not block.slide:
            return number
    return None
