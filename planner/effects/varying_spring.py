"""A joint's own spring that varies: with its angle, with time, with frequency.

All are k Σ ψᵢ φᵢ beside the spring as fitted, with φ of another covariate each.
"""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from planner.dynamics.gradient import Impedance
from planner.effects.effect import Gain, Motions, Operator, PosedBodies, Start
from planner.words import significant

MOST = 0.8  # share of a spring that its waves have at a start


@dataclass(frozen=True)
class VaryingSpring(Operator):
    """`spring` are numbers of springs, `stiffness` theirs in N·m/rad as stated."""

    spring: tuple[int, ...] = ()
    stiffness: tuple[float, ...] = ()

    @abstractmethod
    def shares(self, poses: PosedBodies) -> list[list[np.ndarray]]:
        """φ (n, F) of each number of ψ, for each spring (a list by spring)."""

    def impedance(self, poses: PosedBodies, psi: np.ndarray) -> Impedance:
        """k Σ ψ φ at each spring."""
        count, per = len(self.spring), self.shares(poses)
        ports = np.zeros((len(poses.q), count, len(poses.springs)))
        shapes = np.zeros((count, count, count))
        for row, spring in enumerate(self.spring):
            ports[:, row, poses.springs.index(spring)] = 1.0
            shapes[row, row, row] = 1.0
        terms: list[list[tuple[int, np.ndarray]]] = []
        for row, (waves, k) in enumerate(zip(per, self.stiffness, strict=True)):
            terms += [[(row, k * np.broadcast_to(w, poses.s.shape))] for w in waves]
        values = tuple(
            (row, v * wave)
            for v, one in zip(psi, terms, strict=True) for row, wave in one
        )  # fmt: skip
        return Impedance(ports, shapes, values, tuple(map(tuple, terms)))

    def starts(self, motions: Motions, gain: Gain) -> tuple[Start, ...]:
        """By its columns"""
        columns = motions.changed_by(self.impedance(motions.poses, np.zeros(len(self.numbers))))
        [(nats, psi)] = gain(columns, self.sd)
        return (Start(self, psi, nats),)

    def vanishing(self, psi: np.ndarray) -> np.ndarray:
        """See `Operator.vanishing`."""
        return -psi


@dataclass(frozen=True)
class AngleSpring(VaryingSpring):
    """cos and sin of so many times the joint's angle: gears out of round, balancers."""

    joint: str = ""
    number: int = 0  # of the joint, from 0

    orders: tuple[int, ...] = (1,)

    kind = "angle_dependent_stiffness"

    def shares(self, poses: PosedBodies) -> list[list[np.ndarray]]:
        """See `VaryingSpring.shares`."""
        angle = poses.q[:, self.number, None]
        return [[f(order * angle) for order in self.orders for f in (np.cos, np.sin)]]

    def starts(self, motions: Motions, gain: Gain) -> tuple[Start, ...]:
        """By its columns, with a spring that keeps some stiffness."""
        [start] = super().starts(motions, gain)
        amplitude = _amplitude(start.psi)
        return (replace(start, psi=start.psi * min(1.0, MOST / max(amplitude, MOST))),)

    def taken(self, psi: np.ndarray) -> dict[int, float]:
        """See `Operator.taken`."""
        return {self.spring[0]: self.stiffness[0] * _amplitude(psi)}

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        share = np.sqrt(sum(v**2 for v, _ in values.values()))
        return (
            f"The stiffness of {self.at} varies with its angle, by ± {significant(100 * share)} %."
        )

    def tables(self, values: Mapping[str, tuple[float, float]]) -> dict[str, list[dict[str, Any]]]:
        """Harmonics of [[effects]]."""
        found = []
        for order in self.orders:
            names = {f: f"{f}_{order}" for f in ("cosine", "sine")}
            waves = {f: self.stiffness[0] * values[name][0] for f, name in names.items()}
            found.append({"joint": self.joint, "order": order, **waves})
        return {"harmonic": found}


def _amplitude(psi: np.ndarray) -> float:
    """Of all waves together, cosine and sine of each in turn."""
    return float(np.linalg.norm(psi.reshape(-1, 2), axis=1).sum())


@dataclass(frozen=True)
class Drift(VaryingSpring):
    """Springs that change in the course of the campaign: what is warm, loose or worn."""

    kind = "drift"

    def shares(self, poses: PosedBodies) -> list[list[np.ndarray]]:
        """See `VaryingSpring.shares`."""
        return [[poses.order[:, None]] for _ in self.spring]

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        name, (most, sd) = max(values.items(), key=lambda item: abs(item[1][0]))
        return (
            f"Stiffness changes in the course of the campaign, most at {name.split(' of ')[1]}: by "
            f"{significant(100 * most)} ± {significant(100 * sd, 1)} %. Let the robot warm up, "
            "check for what came loose, and measure an early pose again."
        )


HATS = 4  # over the logarithm of the frequency


@dataclass(frozen=True)
class FrequencyDependentJoint(VaryingSpring):
    """Stiffness and loss that go with the frequency: a servo loop, rubber, a damper."""

    band_hz: tuple[float, float] = (1.0, 100.0)

    kind = "frequency_dependent_joint"
    general = True

    def shares(self, poses: PosedBodies) -> list[list[np.ndarray]]:
        """See `VaryingSpring.shares`."""
        low, high = np.log(self.band_hz)
        at = (np.log(poses.s.imag / (2 * np.pi)) - low) / (high - low) * (HATS - 1)
        hats = [np.maximum(0.0, 1.0 - np.abs(at - k)) for k in range(HATS)]
        return [[*hats, *(1j * hat for hat in hats)]]

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        return (
            f"The stiffness of {self.at} depends on frequency: look at its drive's controller, "
            "its coupling and its damper."
        )
