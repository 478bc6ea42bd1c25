"""Torques of joints (and contacts) that are not linear, beside the spring that is in K.

Every law is a scalar one: an elastic angle θ (rad, or m) gives a restoring torque (N·m, or N).
Arrays of angles have any shape, as many hits and joints are integrated together; a law's numbers
may then be arrays too, which `side_by_side` makes of several laws of a kind.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Protocol

import numpy as np


class JointLaw(Protocol):
    """A torque added to the linear spring's, with an internal state (0 at rest)."""

    def slope(self, step_s: float) -> float:
        """The largest |dτ/dθ| within a time step."""
        ...

    def at_rest(self, shape: tuple[int, ...]) -> np.ndarray:
        """State of as many joints and hits."""
        ...

    def torque(
        self, state: np.ndarray, before: np.ndarray, now: np.ndarray, step_s: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Torque and new state after θ went from `before` to `now` within a time step."""
        ...


class OneState:
    """A law whose state is one number."""

    def at_rest(self, shape: tuple[int, ...]) -> np.ndarray:
        """See `JointLaw`."""
        return np.zeros(shape)


class Elastic(OneState, ABC):
    """A law without a state: torque(θ) is a function of the angle."""

    @abstractmethod
    def at(self, angle: np.ndarray) -> np.ndarray:
        """Torque at an angle."""

    def torque(
        self, state: np.ndarray, before: np.ndarray, now: np.ndarray, step_s: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """See `JointLaw`."""
        return self.at(now), state


def side_by_side(laws: Sequence[JointLaw]) -> JointLaw:
    """Laws of one class as one law of arrays (laws, hits), one row each."""
    kind: Any = type(laws[0])
    rows = {f.name: [[getattr(law, f.name)] for law in laws] for f in fields(kind)}
    return kind(**{name: np.array(row) for name, row in rows.items()})


@dataclass(frozen=True)
class Hardening(Elastic):
    """Stiffness from K at small angles to K + `stiffness` (softening: < 0) at large ones.

    τ = k θ³ / (θ² + a²), a smooth form of a gear's stiffness in steps; `angle` is a.
    """

    stiffness: float
    angle: float

    def slope(self, step_s: float) -> float:
        """9/8 k, at θ = √3 a."""
        return 9 / 8 * abs(self.stiffness)

    def at(self, angle: np.ndarray) -> np.ndarray:
        """See the class."""
        return self.stiffness * angle**3 / (angle**2 + self.angle**2)


@dataclass(frozen=True)
class Backlash(Elastic):
    """A dead zone of ± `gap`, in which only K - `stiffness` is left (seals, preload).

    τ = -k clip(θ, -g, g): beyond the gap the full stiffness K, shifted by the gap.
    """

    stiffness: float
    gap: float

    def slope(self, step_s: float) -> float:
        """k, within the gap."""
        return self.stiffness

    def at(self, angle: np.ndarray) -> np.ndarray:
        """See the class."""
        return -self.stiffness * np.clip(angle, -self.gap, self.gap)


@dataclass(frozen=True)
class Friction(OneState):
    """Presliding friction of Dahl (Bouc–Wen with exponent 1) up to a Coulomb torque.

    dz/dθ = 1 - sgn(dθ) z/z_c, τ = `stiffness` z, z_c = `coulomb` / `stiffness`. The state is z; a
    step is exact for an angle that does not turn back within it, and cannot become unstable.
    """

    stiffness: float
    coulomb: float

    def slope(self, step_s: float) -> float:
        """Just after turning back it is up to twice the stiffness at rest."""
        return 2 * self.stiffness

    def torque(
        self, state: np.ndarray, before: np.ndarray, now: np.ndarray, step_s: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """See the class."""
        limit = self.coulomb / self.stiffness
        way = now - before
        end = np.sign(way) * limit
        after = end + (state - end) * np.exp(-np.abs(way) / limit)
        return self.stiffness * after, after


@dataclass(frozen=True)
class Contact(Elastic):
    """A spring that something else presses on: it lets go beyond its `preload` (m)."""

    stiffness: float
    preload: float

    def slope(self, step_s: float) -> float:
        """k, while it touches."""
        return self.stiffness

    def at(self, angle: np.ndarray) -> np.ndarray:
        """See the class."""
        return self.stiffness * np.maximum(angle, -self.preload)
