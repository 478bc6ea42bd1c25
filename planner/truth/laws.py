"""Torques of joints (and contacts) that are not linear, beside the spring that is in K.

Every law is a scalar one: an elastic angle θ (rad, or m) gives a restoring torque (N·m, or N).
Arrays are (hits,), because the hits at a pose are integrated together.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Protocol

import numpy as np


class JointLaw(Protocol):
    """A torque added to the linear spring's, with an internal state (0 at rest)."""

    @property
    def slope(self) -> float:
        """The largest |dτ/dθ|."""
        ...

    def torque(
        self, state: np.ndarray, before: np.ndarray, now: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Torque and new state after θ went from `before` to `now`."""
        ...


class Elastic(ABC):
    """A law without a state: torque(θ) is a function of the angle."""

    @abstractmethod
    def at(self, angle: np.ndarray) -> np.ndarray:
        """Torque at an angle."""

    def torque(
        self, state: np.ndarray, before: np.ndarray, now: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """See `JointLaw`."""
        return self.at(now), state


@dataclass(frozen=True)
class Hardening(Elastic):
    """Stiffness from K at small angles to K + `stiffness` (softening: < 0) at large ones.

    τ = k θ³ / (θ² + a²), a smooth form of a gear's stiffness in steps; `angle` is a.
    """

    stiffness: float
    angle: float

    @property
    def slope(self) -> float:
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

    @property
    def slope(self) -> float:
        """k, within the gap."""
        return self.stiffness

    def at(self, angle: np.ndarray) -> np.ndarray:
        """See the class."""
        return -self.stiffness * np.clip(angle, -self.gap, self.gap)


@dataclass(frozen=True)
class Friction:
    """Presliding friction of Dahl (Bouc–Wen with exponent 1) up to a Coulomb torque.

    dz/dθ = 1 - sgn(dθ) z/z_c, τ = `stiffness` z, z_c = `coulomb` / `stiffness`. The state is z; a
    step is exact for an angle that does not turn back within it, and cannot become unstable.
    """

    stiffness: float
    coulomb: float

    @property
    def slope(self) -> float:
        """Just after turning back it is up to twice the stiffness at rest."""
        return 2 * self.stiffness

    def torque(
        self, state: np.ndarray, before: np.ndarray, now: np.ndarray
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

    @property
    def slope(self) -> float:
        """k, while it touches."""
        return self.stiffness

    def at(self, angle: np.ndarray) -> np.ndarray:
        """See the class."""
        return self.stiffness * np.maximum(angle, -self.preload)
