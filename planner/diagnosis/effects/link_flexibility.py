"""A link that bends or twists (Birk et al. 2025, section 2.3: elasticity of the structure)."""

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from planner.diagnosis.effects.effect import Quantity, Setting
from planner.diagnosis.effects.extra_compliance import ExtraCompliance, Give, across, told, triple
from planner.diagnosis.effects.places import joint_of, links, own_axis
from planner.diagnosis.thresholds import HALVES_APART_SD, LINK_SHIFT_STIFFNESS, LINK_STIFFNESS
from planner.dynamics.gradient import Impedance
from planner.dynamics.simulation import Simulation
from planner.robot.virtual_joints import OUTER, halves_moved, inertia_basis

SHORTEST = 0.1  # of the longest link: what is shorter is a block


@dataclass(frozen=True)
class LinkFlexibility(ExtraCompliance):
    """Bending about two axes and torsion, half-way to the next joint.

    By ψ (3,) in m the centres of the link's halves are farther off its own than those of a block.
    `length_m` is how far the next joint is.
    """

    name = "link_flexibility"
    length_m: float = 0.0

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
            low, high = (r * _own(simulation, joint_of(simulation, place)) for r in LINK_STIFFNESS)
            axes = [*across(along / length), along / length]
            gives = tuple(Give(triple(a), low, high) for a in axes)
            sd = HALVES_APART_SD * halves_moved(robot, link)[0]
            own = tuple(Quantity(f"apart_{a}", "m", 0.0, sd) for a in "xyz") if sd > 0 else ()
            found += [cls(place, own, link, g, length) for g in (gives[:2], gives[2:], gives)]
        return tuple(found)

    def bends_at_one_place(self) -> bool:
        """Whether the link has hinges across its way, and nothing that shifts its halves."""
        return len(self.gives) > 1 and not any(give.slide for give in self.gives)

    def as_beam(self) -> "LinkFlexibility":
        """The same where the halves shift past each other too, as those of a beam do.

        Two halves on a hinge of stiffness EI/L and a slide of 12 EI/L³ give at their end as a
        uniform beam of length L: L³/(3 EI), L²/(2 EI), L/(EI).
        """
        low, high = (r / self.length_m**2 for r in LINK_SHIFT_STIFFNESS)
        first, second = self.gives[:2]
        slides = tuple(
            replace(bending, axis=way, lower=low * bending.lower, upper=high * bending.upper,
                    slide=True)
            for bending, way in ((first, second.axis), (second, first.axis))
        )  # fmt: skip
        return replace(self, gives=(*self.gives, *slides))

    def impedance(self, setting: Setting, psi: np.ndarray) -> tuple[Impedance, ...]:
        """s² Σ Jᵀ ΔI(ψ) J of both halves."""
        if not len(psi):
            return ()
        inner = setting.body(joint_of(setting.simulation, self.at))
        ports = np.concatenate([inner, setting.body(self.joint + OUTER)], axis=1)
        changes = halves_moved(setting.simulation.robot, self.joint)[1]
        basis = inertia_basis()
        halves = np.einsum("khb,bij->khij", changes, basis)
        unit = np.array([scipy.linalg.block_diag(*both) for both in halves])
        shapes = np.concatenate([np.einsum("k,kij->ij", psi, unit)[None], unit])
        s2 = setting.s**2
        return (Impedance(ports, shapes, ((0, s2),), tuple(((k, s2),) for k in (1, 2, 3))),)

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        return (
            f"{self.at} gives between its joints, with a stiffness of {told(values)}: its "
            f"structure bends or twists, which joints alone cannot describe."
        )


def _own(simulation: Simulation, joint: str) -> float:
    """Stiffness about a joint's own axis, or the least that it has, in N·m/rad."""
    robot = simulation.robot
    if robot.slides(joint):
        return min(robot.turning_stiffness(joint))
    axis, blocks = own_axis(simulation, joint), robot.config.compliance
    there = [b for b in blocks if b.joint == joint] or list(blocks)
    own = [b.stiffness for b in there if abs(np.array(b.axis) @ axis) > 0.9]
    return float(min(own or [b.stiffness for b in there]))
