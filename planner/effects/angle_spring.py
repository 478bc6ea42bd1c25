"""A joint whose stiffness goes with its angle: gears out of round, springs of balancers."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from planner.dynamics.gradient import Impedance
from planner.effects.effect import Gain, Motions, Operator, PosedBodies, Start

FARTHEST = 0.5  # share of the stiffness, of a start


@dataclass(frozen=True)
class AngleSpring(Operator):
    """k (1 + ψ₀ cos q + ψ₁ sin q) of a joint's own spring."""

    joint: str = ""
    number: int = 0  # of the joint, from 0
    spring: int = 0
    stiffness: float = 1.0

    kind = "angle_dependent_spring"

    def impedance(self, poses: PosedBodies, psi: np.ndarray) -> Impedance:
        """Its share of the stated stiffness."""
        ports = np.zeros((len(poses.q), 1, len(poses.springs)))
        ports[:, 0, poses.springs.index(self.spring)] = 1.0
        angle = poses.q[:, self.number, None]
        waves = [self.stiffness * f(angle) * np.ones(poses.s.shape) for f in (np.cos, np.sin)]
        whole = psi[0] * waves[0] + psi[1] * waves[1]
        return Impedance(ports, np.ones((1, 1, 1)), ((0, whole),), tuple(((0, w),) for w in waves))

    def starts(self, motions: Motions, gain: Gain) -> tuple[Start, ...]:
        """By its two columns."""
        poses = motions.poses
        one, minus = self.impedance(poses, np.zeros(2)), -(poses.s**2)[:, None, None]
        shape = (len(poses.q), 2, motions.x_sensor.shape[2], motions.x_hit.shape[2], minus.shape[3])
        columns = np.empty(shape, dtype=complex)
        one.gradient(motions.x_hit * minus, motions.x_sensor, columns)
        nats, psi = gain(columns, self.sd)
        return (Start(self, np.clip(psi, -FARTHEST, FARTHEST), nats),)

    def vanishing(self, psi: np.ndarray) -> np.ndarray:
        """See `Operator.vanishing`."""
        return -psi

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        share = np.hypot(values["cosine"][0], values["sine"][0])
        return f"The stiffness of {self.at} goes with its angle, by ± {100 * share:.2g} %."

    def tables(self, values: Mapping[str, tuple[float, float]]) -> dict[str, list[dict[str, Any]]]:
        """A harmonic of [[effects]]."""
        waves = {name: self.stiffness * values[name][0] for name in ("cosine", "sine")}
        return {"harmonic": [{"joint": self.joint, "order": 1, **waves}]}
