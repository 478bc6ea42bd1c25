"""A joint much softer or stiffer than stated."""

from dataclasses import dataclass, replace

from planner.diagnose.effect import Effect
from planner.diagnose.effects.places import joint_of, joints
from planner.identify.parameters import Priors, axis_name
from planner.physics.simulation import Simulation

FAR = 8.0  # either way


@dataclass(frozen=True)
class JointStiffness(Effect):
    """Nothing new in the simulation: the prior of the joint's springs is widened."""

    name = "joint_stiffness"

    @classmethod
    def everywhere(cls, simulation: Simulation) -> tuple["JointStiffness", ...]:
        """At every joint that has a spring."""
        there = {b.joint for b in simulation.robot.config.compliance}
        return tuple(cls(place) for place, joint in joints(simulation) if joint in there)

    def springs(self, simulation: Simulation) -> tuple[str, ...]:
        """Stiffnesses of the joint."""
        joint = joint_of(simulation, self.at)
        blocks = simulation.robot.config.compliance
        return tuple(
            f"stiffness of {b.tie or f'{joint} about {axis_name(b.axis)}'}"
            for b in blocks
            if b.joint == joint
        )

    def priors(self, simulation: Simulation, priors: Priors) -> Priors:
        """Log-uniform within a factor FAR."""
        joint = joint_of(simulation, self.at)
        stated = [b.stiffness for b in simulation.robot.config.compliance if b.joint == joint]
        names = self.springs(simulation)
        wide = {n: (k / FAR, k * FAR) for n, k in zip(names, stated, strict=True)}
        return replace(priors, bounds={**priors.bounds, **wide})

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        told = ", ".join(f"{v:.3g} ± {sd:.1g} {u}" for v, sd, u in values.values())
        return f"{self.at} is far from its stated stiffness ({told}): check gear, belt and brake."
