"""A joint much softer or stiffer than stated."""

from dataclasses import dataclass, replace

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.effects.places import joint_of, joints
from planner.diagnosis.effects.slight_bearings import is_slight
from planner.diagnosis.thresholds import FAR_SPRING_FACTOR
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Priors, place_name
from planner.robot.config import Compliance


@dataclass(frozen=True)
class JointStiffness(Effect):
    """Nothing new in the simulation: the prior of springs is widened, of one axis or of all."""

    only_own: bool = False

    name = "joint_stiffness"
    absorbed = True

    @classmethod
    def everywhere(cls, simulation: Simulation) -> tuple["JointStiffness", ...]:
        """At every joint that has a spring: about its own axis, and where there are more, all."""
        found = []
        for place, _ in joints(simulation):
            own, every = cls(place, (), True), cls(place)
            count = len(every._blocks(simulation))
            if 0 < len(own._blocks(simulation)) < count:
                found.append(own)
            if count:
                found.append(every)
        return tuple(found)

    def _blocks(self, simulation: Simulation) -> list[Compliance]:
        robot, joint = simulation.robot, joint_of(simulation, self.at)
        there = [b for b in robot.config.compliance if b.joint == joint and not is_slight(b)]
        return [b for b in there if not self.only_own or robot.is_own(b)]

    def springs(self, simulation: Simulation) -> tuple[str, ...]:
        """Names of the joint's stiffnesses."""
        return tuple(f"stiffness of {b.tie or place_name(b)}" for b in self._blocks(simulation))

    def priors(self, simulation: Simulation, priors: Priors) -> Priors:
        """Log-uniform within FAR_SPRING_FACTOR; what is loose or stiff is damped otherwise too."""
        bounds = dict(priors.bounds)
        for block in self._blocks(simulation):
            for kind, value in (("stiffness", block.stiffness), ("damping", block.damping)):
                if value > 0:
                    name = f"{kind} of {block.tie or place_name(block)}"
                    bounds[name] = (value / FAR_SPRING_FACTOR, value * FAR_SPRING_FACTOR)
        return replace(priors, bounds=bounds)

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        told = ", ".join(f"{v:.3g} ± {sd:.1g} {u}" for v, sd, u in values.values())
        parts = "drive, belt and brake" if _slides(values) else "gear, belt and brake"
        return f"{self.at} is far from its stated stiffness ({told}): check {parts}."


def _slides(values: dict[str, tuple[float, float, str]]) -> bool:
    return all(unit.endswith("/m") for _, _, unit in values.values())
