"""Something loose on a link that swings in all directions, in each at a frequency of its own."""

from dataclasses import dataclass
from itertools import combinations, product
from typing import Any, Self

import numpy as np
from scipy.spatial.transform import Rotation

from planner.diagnosis.effects.effect import Quantity, Setting
from planner.diagnosis.effects.local_resonator import ACROSS, LocalResonator, moving, turning
from planner.diagnosis.effects.places import joint_of
from planner.dynamics.gradient import Impedance
from planner.dynamics.simulation import Simulation

TURN_SD = 1.0  # rad, of the axes of its springs
# Starts: masses, in middling ones; frequencies from this part of the band's end to so many times it
MASSES, FREQUENCIES, BELOW, ABOVE = (1.0, 2.5), 5, 8.0, 1.6
WAYS = "frequency", "frequency_2", "frequency_3"


@dataclass(frozen=True)
class HangingResonator(LocalResonator):
    """A mass on three springs at right angles, where a `LocalResonator` slides along one.

    It is looked for from there, and by itself from many `starts` (`linear.three_axis_resonators`).
    """

    @classmethod
    def of(cls, sliding: LocalResonator) -> Self:
        """At the place of one that slides along one direction."""
        known = {q.name: q for q in sliding.quantities}
        f = known["frequency"]
        quantities = (
            known["mass"],
            *(Quantity(name, "Hz", f.mean, f.sd, True) for name in WAYS),
            known["damping_ratio"],
            *(Quantity(f"turn_{a}", "rad", 0.0, TURN_SD) for a in "xyz"),
            *(known[f"position_{a}"] for a in "xyz"),
        )
        return cls(sliding.at, quantities, sliding.low_hz, sliding.high_hz)

    @property
    def log_frequencies(self) -> np.ndarray:
        """ln Hz where its frequencies may begin, over the band and above."""
        lowest = max(self.low_hz, self.high_hz / BELOW)
        return np.log(np.geomspace(lowest, ABOVE * self.high_hz, FREQUENCIES))

    def starts(self) -> np.ndarray:
        """Any three of some frequencies along any of the link's axes; light and heavy."""
        middle = np.array([q.mean for q in self.quantities])
        out = []
        for times in MASSES:
            for three, shift in product(combinations(self.log_frequencies, 3), range(3)):
                start = middle.copy()
                start[0] += np.log(times)
                start[1:4] = np.roll(three, shift)
                out.append(start)
        return np.array(out)

    def impedance(self, setting: Setting, psi: np.ndarray) -> tuple[Impedance, ...]:
        """s² m Jₚᵀ [Σ Tₖ dₖ dₖᵀ] Jₚ with the transmissibilities Tₖ of springs and dampers."""
        mass, omega, zeta = np.exp(psi[0]), 2 * np.pi * np.exp(psi[1:4]), np.exp(psi[4])
        axes, place = Rotation.from_rotvec(psi[5:8]).as_matrix().T, psi[8:11]
        jacobian = setting.body(joint_of(setting.simulation, self.at))
        linear = jacobian[:, :3] + np.tensordot(place, ACROSS, 1) @ jacobian[:, 3:]
        s = setting.s
        m = mass * s**2
        stiff, damped = omega[:, None, None] ** 2, 2 * zeta * omega[:, None, None] * s
        above, below = stiff + damped, s**2 + stiff + damped
        t, squared = m * above / below, below**2
        # derivatives of T by ln ω and ln ζ
        by_omega = m * ((2 * stiff + damped) * below - above * (2 * stiff + damped)) / squared
        by_zeta = m * damped * (below - above) / squared
        along = [np.outer(d, d) for d in axes]
        turned = [np.cross(way, axes) for way in _left_jacobian(psi[5:8]).T]  # ∂dₖ/∂rᵥ
        shapes = [moving(one) for one in along]
        shapes += [
            moving(np.outer(by, d) + np.outer(d, by))
            for each in turned
            for by, d in zip(each, axes, strict=True)
        ]
        shapes += [turning(one @ across) for across in ACROSS for one in along]
        values = tuple(enumerate(t))
        slope = [values, *(((k, by_omega[k]),) for k in range(3)), tuple(enumerate(by_zeta))]
        slope += [tuple((3 + 3 * v + k, t[k]) for k in range(3)) for v in range(6)]
        ports = np.concatenate([linear, jacobian[:, 3:]], axis=1)
        return (Impedance(ports, np.array(shapes), values, tuple(slope)),)

    def elements(
        self, simulation: Simulation, values: dict[str, tuple[float, float, str]]
    ) -> dict[str, list[dict[str, Any]]]:
        """Three that slide, each carried across its way: less twice the mass, which is there once.

        See `Effect.elements`.
        """
        place, turn = ([values[f"{w}_{a}"][0] for a in "xyz"] for w in ("position", "turn"))
        axes, mass = Rotation.from_rotvec(turn).as_matrix().T, values["mass"][0]
        joint = joint_of(simulation, self.at)
        common = {"joint": joint, "position_m": place, "mass": mass}
        blocks = [
            common
            | {
                "direction": axis.tolist(),
                "frequency_hz": values[name][0],
                "damping_ratio": values["damping_ratio"][0],
            }
            for axis, name in zip(axes, WAYS, strict=True)
        ]
        link = simulation.robot.link_of(joint)
        return {
            "resonator": blocks,
            "payload": [{"link": link, "mass": -2 * mass, "com_m": place}],
        }

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        hz = ", ".join(f"{f:.1f}" for f in sorted(values[name][0] for name in WAYS))
        return (
            f"Something of {values['mass'][0]:.2g} kg on {self.at} swings on its own, at {hz} Hz "
            f"in three directions: check hose pack, brackets and covers there."
        )


def _left_jacobian(r: np.ndarray) -> np.ndarray:
    """(3, 3): by what rotation a small change of the rotation vector r (3,) turns what it turns."""
    angle = np.linalg.norm(r)
    skew = np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])
    if angle < 1e-6:
        return np.eye(3) + skew / 2
    first, second = (1 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    return np.eye(3) + first * skew + second * skew @ skew
