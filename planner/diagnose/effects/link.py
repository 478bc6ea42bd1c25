"""A link that bends or twists (seed 004, section 2.3: elasticity of the structure)."""

from dataclasses import dataclass

import numpy as np

from planner.diagnose.effects.extra import ExtraCompliance, Give, across, told, triple
from planner.diagnose.effects.places import joint_of, links, own_axis
from planner.physics.simulation import Simulation

REACH = (0.1, 10.0)  # times the stiffness of the joint that moves the link, about its own axis
SHORTEST = 0.1  # of the longest link: what is shorter is a block


@dataclass(frozen=True)
class LinkFlexibility(ExtraCompliance):
    """Bending about two axes and torsion, half-way to the next joint."""

    name = "link_flexibility"

    @classmethod
    def everywhere(cls, simulation: Simulation) -> tuple["LinkFlexibility", ...]:
        """On every link long enough that carries another, and of which robot.toml lists nothing."""
        robot, found = simulation.robot, []
        listed = {b.joint for b in robot.config.compliance}
        placements = robot.model.jointPlacements
        longest = max(float(np.linalg.norm(p.translation)) for p in placements)
        for place, joint in links(simulation):
            link = robot.link_of(joint)
            carried = robot.carries(link)
            if carried is None or link in listed or link in robot.joint_names:
                continue
            along = np.array(placements[carried[1]].translation)
            length = float(np.linalg.norm(along))
            if length < SHORTEST * longest:
                continue
            low, high = (r * _own(simulation, joint_of(simulation, place)) for r in REACH)
            axes = [*across(along / length), along / length]
            gives = tuple(Give(triple(a), low, high) for a in axes)
            found += [cls(place, (), link, gives[:2]), cls(place, (), link, gives[2:])]
            found.append(cls(place, (), link, gives))
        return tuple(found)

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        return (
            f"{self.at} gives between its joints, with a stiffness of {told(values)}: its "
            f"structure bends or twists, which joints alone cannot describe."
        )


def _own(simulation: Simulation, joint: str) -> float:
    """Stiffness about a joint's own axis, or the least that it has."""
    axis = own_axis(simulation, joint)
    blocks = simulation.robot.config.compliance
    there = [b for b in blocks if b.joint == joint] or list(blocks)
    own = [b.stiffness for b in there if abs(np.array(b.axis) @ axis) > 0.9]
    return float(min(own or [b.stiffness for b in there]))
