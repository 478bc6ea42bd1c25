"""A joint's stiffness that changes with its angle: gear contact, gravity compensator."""

from dataclasses import dataclass

import numpy as np

from planner.diagnose.effect import Effect, Quantity, Setting
from planner.diagnose.effects.places import joint_of, joints, own_axis
from planner.physics.gradient import Impedance
from planner.physics.simulation import Simulation

SD = 0.3  # of the stiffness
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
                waves = ("cosine", "sine")
                quantities = tuple(Quantity(w, "N·m/rad", 0.0, SD * k) for w in waves)
                found += [cls(place, quantities, order) for order in ORDERS]
        return tuple(found)

    def impedance(self, setting: Setting, psi: np.ndarray) -> Impedance:
        """On the diagonal, one value a pose."""
        simulation = setting.simulation
        joint = joint_of(simulation, self.at)
        number = _block(simulation, joint)
        assert number is not None
        angle = self.order * setting.q[:, simulation.robot.joint_names.index(joint)]
        waves = np.stack([np.cos(angle), np.sin(angle)], axis=1)  # (n, 2)
        (n, f), e = setting.s.shape, simulation.elastic.size
        slope = np.zeros((n, 2, f, e, e), dtype=complex)
        slope[..., number, number] = waves[:, :, None]
        return Impedance(np.einsum("p,npfij->nfij", psi, slope), slope)

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        size = float(np.hypot(values["cosine"][0], values["sine"][0]))
        times = {1: "once", 2: "twice"}[self.order]
        return (
            f"The stiffness of {self.at} changes with its angle, {times} a turn, by ± {size:.2g} "
            f"N·m/rad: check gear, gravity compensator and cables."
        )


def _block(simulation: Simulation, joint: str) -> int | None:
    axis = own_axis(simulation, joint)
    for number, block in enumerate(simulation.robot.config.compliance):
        if block.joint == joint and abs(np.array(block.axis) @ axis) > 0.9:
            return number
    return None
