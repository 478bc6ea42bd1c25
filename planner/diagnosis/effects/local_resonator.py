"""Something loose on a link: a mass on a spring of its own (hose pack, bracket)."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from planner.diagnosis.effects.added_mass import link_size
from planner.diagnosis.effects.effect import Effect, Quantity, Setting
from planner.diagnosis.effects.places import joint_of, links
from planner.diagnosis.thresholds import ADDED_PLACE_SD, RESONATOR_MASS
from planner.dynamics.gradient import Impedance
from planner.dynamics.simulation import Simulation

FREQUENCIES = 6  # starts over the band
# (3, 3, 3): what turns with a link at w moves what lies at e_v by ACROSS[v] w = w × e_v
ACROSS = np.array([np.cross(np.eye(3), e).T for e in np.eye(3)])
LITTLE = 0.3  # of the middling mass: starts change little, and their gradients tell how much


@dataclass(frozen=True)
class LocalResonator(Effect):
    """A mass that slides along a direction of the link, held by spring and damper."""

    low_hz: float = 1.0
    high_hz: float = 100.0

    name = "local_resonator"

    @classmethod
    def everywhere(cls, simulation: Simulation) -> tuple["LocalResonator", ...]:
        """One effect for each link."""
        mass = RESONATOR_MASS * float(np.mean([b[0] for b in simulation.elastic.inertia]))
        size, (low, high) = ADDED_PLACE_SD * link_size(simulation), simulation.robot.config.band_hz
        found = []
        for place, joint in links(simulation):
            if joint not in simulation.elastic.bodies:
                continue
            body = simulation.elastic.inertia[simulation.elastic.bodies.index(joint)]
            com = body[1:4] / body[0] if body[0] > 0 else np.zeros(3)
            middle, spread = np.log(low * high) / 2, np.log(high / low) / np.sqrt(12)
            quantities = (
                Quantity("mass", "kg", float(np.log(mass)), 1.0, True),
                Quantity("frequency", "Hz", float(middle), float(spread), True),
                Quantity("damping_ratio", "1", float(np.log(0.02)), 1.0, True),
                *(Quantity(f"direction_{a}", "1", 0.0, 1.0) for a in "xyz"),
                *(
                    Quantity(f"position_{a}", "m", float(c), size)
                    for a, c in zip("xyz", com, strict=True)
                ),
            )
            found.append(cls(place, quantities, low, high))
        return tuple(found)

    def starts(self) -> np.ndarray:
        """Several frequencies in each of three directions."""
        middle = np.array([q.mean for q in self.quantities])
        ratio = self.high_hz / self.low_hz
        shares = (np.arange(FREQUENCIES) + 0.5) / FREQUENCIES
        out = []
        for f in self.low_hz * ratio**shares:
            for axis in range(3):
                start = middle.copy()
                start[0] += np.log(LITTLE)
                start[1] = np.log(f)
                start[3 + axis] = 1.0
                out.append(start)
        return np.array(out)

    def impedance(self, setting: Setting, psi: np.ndarray) -> tuple[Impedance, ...]:
        """s² m Jₚᵀ [1 + (T − 1) d dᵀ] Jₚ with the transmissibility T of spring and damper."""
        mass, omega, zeta = np.exp(psi[0]), 2 * np.pi * np.exp(psi[1]), np.exp(psi[2])
        length = np.linalg.norm(psi[3:6]) + 1e-12
        d, place = psi[3:6] / length, psi[6:9]
        jacobian = setting.body(joint_of(setting.simulation, self.at))
        linear = jacobian[:, :3] + np.tensordot(place, ACROSS, 1) @ jacobian[:, 3:]
        s = setting.s
        below = s**2 + 2 * zeta * omega * s + omega**2
        above = 2 * zeta * omega * s + omega**2
        t = above / below
        # derivatives of T with respect to ln ω and ln ζ
        d_above = np.stack([2 * zeta * omega * s + 2 * omega**2, 2 * zeta * omega * s])
        t_slope = (d_above * below - above * d_above) / below**2
        turn = (np.eye(3) - np.outer(d, d)) / length  # ∂d/∂v
        along = np.outer(d, d)
        # Ports: the place's motion and the link's turn, which moves what lies at e by turn × e.
        shapes = [moving(np.eye(3)), moving(along)]
        shapes += [moving(np.outer(turn[v], d) + np.outer(d, turn[v])) for v in range(3)]
        shapes += [turning(one) for one in ACROSS]
        shapes += [turning(along @ one) for one in ACROSS]
        m = mass * s**2
        u = m * (t - 1)
        values = (0, m), (1, u)
        slope = [values, ((1, m * t_slope[0]),), ((1, m * t_slope[1]),)]
        slope += [((2 + v, u),) for v in range(3)]
        slope += [((5 + v, m), (8 + v, u)) for v in range(3)]
        ports = np.concatenate([linear, jacobian[:, 3:]], axis=1)
        return (Impedance(ports, np.array(shapes), values, tuple(slope)),)

    def elements(
        self, simulation: Simulation, values: dict[str, tuple[float, float, str]]
    ) -> dict[str, list[dict[str, Any]]]:
        """See `Effect.elements`."""
        place, way = (
            np.array([values[f"{what}_{a}"][0] for a in "xyz"])
            for what in ("position", "direction")
        )
        block = {
            "joint": joint_of(simulation, self.at),
            "position_m": place.tolist(),
            "direction": (way / np.linalg.norm(way)).tolist(),
            "mass": values["mass"][0],
            "frequency_hz": values["frequency"][0],
            "damping_ratio": values["damping_ratio"][0],
        }
        return {"resonator": [block]}

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        return (
            f"Something of {values['mass'][0]:.2g} kg on {self.at} swings on its own at "
            f"{values['frequency'][0]:.1f} Hz: check hose pack, brackets and covers there."
        )


def moving(shape: np.ndarray) -> np.ndarray:
    """(6, 6): a shape (3, 3) of velocities alone."""
    out = np.zeros((6, 6))
    out[:3, :3] = shape
    return out


def turning(shape: np.ndarray) -> np.ndarray:
    """(6, 6): a shape (3, 3) between velocities and rates of turn, and its transpose."""
    out = np.zeros((6, 6))
    out[:3, 3:], out[3:, :3] = shape, shape.T
    return out
