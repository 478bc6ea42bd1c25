"""A mass on a link that the simulation does not know, or a payload stated too large."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from planner.diagnosis.effects.effect import Effect, Quantity, Setting
from planner.diagnosis.effects.places import joint_of, links
from planner.diagnosis.thresholds import ADDED_MASS_SD, ADDED_PLACE_SD
from planner.dynamics.gradient import Impedance
from planner.dynamics.simulation import Simulation
from planner.robot.virtual_joints import inertia_basis


def link_size(simulation: Simulation) -> float:
    """Length in m of the longest distance between joints that follow each other."""
    places = simulation.robot.model.jointPlacements
    return max(float(np.linalg.norm(p.translation)) for p in places)


def point_mass(p: np.ndarray) -> np.ndarray:
    """(10,) inertial parameters of 1 kg at p (3,), and (3, 10) their derivatives."""
    x, y, z = p
    moments = [y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y]
    return np.array([1.0, x, y, z, *moments])


def point_mass_slope(p: np.ndarray) -> np.ndarray:
    """(3, 10): derivatives of `point_mass` with respect to p."""
    x, y, z = p
    return np.array(
        [
            [0, 1, 0, 0, 0, -y, 2 * x, -z, 0, 2 * x],
            [0, 0, 1, 0, 2 * y, -x, 0, 0, -z, 2 * y],
            [0, 0, 0, 1, 2 * z, 0, 2 * z, -x, -y, 0],
        ],
        dtype=float,
    )


@dataclass(frozen=True)
class AddedMass(Effect):
    """A point mass at a place in the link's frame."""

    joint: str = ""

    name = "added_mass"
    absorbed = True

    @classmethod
    def everywhere(cls, simulation: Simulation) -> tuple["AddedMass", ...]:
        """One effect for each link."""
        masses = [b[0] for b in simulation.elastic.inertia]
        mass, size = ADDED_MASS_SD * float(np.mean(masses)), ADDED_PLACE_SD * link_size(simulation)
        found = []
        for place, joint in links(simulation):
            if joint not in simulation.elastic.bodies:
                continue
            body = simulation.elastic.inertia[simulation.elastic.bodies.index(joint)]
            com = body[1:4] / body[0] if body[0] > 0 else np.zeros(3)
            quantities = [Quantity("mass", "kg", 0.0, mass)]
            quantities += [
                Quantity(f"position_{a}", "m", float(c), size)
                for a, c in zip("xyz", com, strict=True)
            ]
            found.append(cls(place, tuple(quantities), joint))
        return tuple(found)

    def starts(self) -> np.ndarray:
        """A little more and a little less mass at the link's centre of mass."""
        middle = np.array([q.mean for q in self.quantities])
        little = np.array([0.3 * self.quantities[0].sd, 0, 0, 0])
        return np.array([middle + little, middle - little])

    def impedance(self, setting: Setting, psi: np.ndarray) -> tuple[Impedance, ...]:
        """s² Jᵀ I(m, p) J."""
        jacobian = setting.body(joint_of(setting.simulation, self.at))
        mass, place = psi[0], psi[1:]
        unit, slope = point_mass(place), point_mass_slope(place)
        weights = np.vstack([mass * unit, unit, mass * slope])  # value, d/dm, d/dp
        inertias = np.einsum("kb,bij->kij", weights, inertia_basis())
        s2 = setting.s**2
        own = tuple(((k, s2),) for k in range(1, len(inertias)))
        return (Impedance(jacobian, inertias, ((0, s2),), own),)

    def elements(
        self, simulation: Simulation, values: dict[str, tuple[float, float, str]]
    ) -> dict[str, list[dict[str, Any]]]:
        """See `Effect.elements`."""
        mass, *place = (values[n][0] for n in ("mass", *(f"position_{a}" for a in "xyz")))
        link = simulation.robot.link_of(joint_of(simulation, self.at))
        return {"payload": [{"link": link, "mass": mass, "com_m": place}]}

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        mass, sd, _ = values["mass"]
        place = ", ".join(f"{values[f'position_{a}'][0]:.2f}" for a in "xyz")
        what = "more" if mass > 0 else "less"
        return (
            f"{self.at} carries {abs(mass):.3g} ± {sd:.1g} kg {what} than stated, at ({place}) m "
            f"in its frame: check payload, cables and tool."
        )
