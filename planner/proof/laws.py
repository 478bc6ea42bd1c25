"""Torques of joints (and contacts) that are not linear, beside the spring that is in K.

Every law is a scalar one: an elastic angle θ (rad, or m) gives a restoring torque (N·m, or N).
Arrays of angles have any shape, as many hits and joints are integrated together; a law's numbers
may then be arrays too, which `stacked` makes of several laws of a kind.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

SLIDERS = 8  # of an Iwan joint

Pair = tuple[np.ndarray, np.ndarray]  # torque and new state


class JointLaw(ABC):
    """A torque added to the linear spring's, with an internal state (0 at rest)."""

    @abstractmethod
    def slope(self, step_s: float) -> float:
        """The largest |dτ/dθ| within a time step."""

    def at_rest(self, shape: tuple[int, ...]) -> np.ndarray:
        """State of as many joints and hits."""
        return np.zeros(shape)

    @abstractmethod
    def torque(self, state: np.ndarray, before: np.ndarray, now: np.ndarray, step_s: float) -> Pair:
        """Torque and new state after θ went from `before` to `now` within a time step."""


@dataclass(frozen=True)
class Stiff(JointLaw):
    """A law with a stiffness, which nowhere is larger unless it says so."""

    stiffness: float

    def slope(self, step_s: float) -> float:
        return abs(self.stiffness)


class Elastic(Stiff):
    """A law without a state: torque(θ) is a function of the angle."""

    @abstractmethod
    def at(self, angle: np.ndarray) -> np.ndarray:
        """Torque at an angle."""

    def torque(self, state: np.ndarray, before: np.ndarray, now: np.ndarray, step_s: float) -> Pair:
        return self.at(now), state


def _slid(state: np.ndarray, way: np.ndarray, limit: Any) -> np.ndarray:
    """Deflection of bristles after a way, which tends to ± limit."""
    end = np.sign(way) * limit
    return end + (state - end) * np.exp(-np.abs(way) / limit)


def stacked(laws: Sequence[JointLaw]) -> JointLaw:
    """Laws of one class as one law of arrays (laws, hits), one row each."""
    kind: Any = type(laws[0])
    rows = {f.name: [[getattr(law, f.name)] for law in laws] for f in fields(kind)}
    return kind(**{name: np.array(row) for name, row in rows.items()})


@dataclass(frozen=True)
class Hardening(Elastic):
    """Stiffness from K at small angles to K + `stiffness` (softening: < 0) at large ones.

    τ = k θ³ / (θ² + a²), a smooth form of a gear's stiffness in steps; `angle` is a.
    """

    angle: float

    def slope(self, step_s: float) -> float:
        """9/8 k, at θ = √3 a."""
        return 9 / 8 * abs(self.stiffness)

    def at(self, angle: np.ndarray) -> np.ndarray:
        return self.stiffness * angle**3 / (angle**2 + self.angle**2)


@dataclass(frozen=True)
class Backlash(Elastic):
    """A dead zone of ± `gap`, in which only K - `stiffness` is left (seals, preload).

    τ = -k clip(θ, -g, g): beyond the gap the full stiffness K, shifted by the gap.
    """

    gap: float

    def at(self, angle: np.ndarray) -> np.ndarray:
        return -self.stiffness * np.clip(angle, -self.gap, self.gap)


@dataclass(frozen=True)
class Friction(Stiff):
    """Presliding friction of Dahl (Bouc–Wen with exponent 1) up to a Coulomb torque.

    dz/dθ = 1 - sgn(dθ) z/z_c, τ = `stiffness` z, z_c = `coulomb` / `stiffness`. The state is z; a
    step is exact for an angle that does not turn back within it, and cannot become unstable.
    """

    coulomb: float

    def slope(self, step_s: float) -> float:
        """Just after turning back it is up to twice the stiffness at rest."""
        return 2 * self.stiffness

    def torque(self, state: np.ndarray, before: np.ndarray, now: np.ndarray, step_s: float) -> Pair:
        after = _slid(state, now - before, self.coulomb / self.stiffness)
        return self.stiffness * after, after


@dataclass(frozen=True)
class Contact(Elastic):
    """A spring that something else presses on: it lets go beyond its `preload` (m)."""

    preload: float

    def at(self, angle: np.ndarray) -> np.ndarray:
        return self.stiffness * np.maximum(angle, -self.preload)


@dataclass(frozen=True)
class HarmonicDrive(Elastic):
    """Stiffness in three steps: K, from `first` on K + `stiffness`, from `second` on twice more.

    As catalogues state it. τ = k [|θ| - θ₁]₊ + k [|θ| - θ₂]₊ with θ's sign.
    """

    first: float
    second: float

    def slope(self, step_s: float) -> float:
        """2 k, beyond the second knee."""
        return 2 * abs(self.stiffness)

    def at(self, angle: np.ndarray) -> np.ndarray:
        size = np.abs(angle)
        over = np.maximum(size - self.first, 0) + np.maximum(size - self.second, 0)
        return self.stiffness * np.sign(angle) * over


@dataclass(frozen=True)
class AmplitudeSoftening(Elastic):
    """Stiffness from K at small angles to K - `stiffness` at large ones, as 1 / √(1 + θ²/a²).

    τ = -k (θ - a asinh(θ/a)); `angle` is a. Negative k hardens.
    """

    angle: float

    def at(self, angle: np.ndarray) -> np.ndarray:
        return -self.stiffness * (angle - self.angle * np.arcsinh(angle / self.angle))


@dataclass(frozen=True)
class BoucWen(Stiff):
    """Hysteresis dz/dθ = 1 - |z/z_c|² (1 + sgn(z dθ)) / 2, τ = `stiffness` z, up to `coulomb`.

    Straight while it unloads, tanh while it loads. The state is z.
    """

    coulomb: float

    def torque(self, state: np.ndarray, before: np.ndarray, now: np.ndarray, step_s: float) -> Pair:
        limit = self.coulomb / self.stiffness
        way = now - before
        sense = np.sign(way)
        loaded = sense * state  # < 0 while it unloads
        straight = np.minimum(np.abs(way), np.maximum(-loaded, 0))
        start = np.clip((loaded + straight) / limit, -1 + 1e-12, 1 - 1e-12)
        ends = limit * np.tanh(np.arctanh(start) + (np.abs(way) - straight) / limit)
        after = np.where(way == 0, state, sense * ends)
        return self.stiffness * after, after


@dataclass(frozen=True)
class Iwan(Stiff):
    """Masing's hysteresis: sliders in parallel, of limits spread evenly from 0 to 2 z_c.

    All slide at `coulomb`; at rest they have `stiffness` together. States (sliders, ...) are their
    springs' deflections.
    """

    coulomb: float

    def at_rest(self, shape: tuple[int, ...]) -> np.ndarray:
        return np.zeros((SLIDERS, *shape))

    def limits(self) -> np.ndarray:
        """Deflections (sliders, ...) at which they slide."""
        share = (np.arange(SLIDERS) + 0.5) * 2 / SLIDERS
        return np.multiply.outer(share, self.coulomb / self.stiffness)

    def torque(self, state: np.ndarray, before: np.ndarray, now: np.ndarray, step_s: float) -> Pair:
        limit = self.limits()
        poses = state.ndim - limit.ndim  # further axes, which limits do not have
        limit = limit.reshape(SLIDERS, *[1] * poses, *limit.shape[1:])
        after = np.minimum(np.maximum(state + (now - before), -limit), limit)
        return self.stiffness * after.mean(axis=0), after


@dataclass(frozen=True)
class LuGre(Stiff):
    """Bristles of `stiffness`: `stiction` at rest falls to `coulomb` with speed (Stribeck).

    dz/dt = v - σ₀ |v| z / g(v), g = F_c + (F_s - F_c) exp(-(v/v_s)²), τ = σ₀ z + `viscous` v.
    """

    coulomb: float
    stiction: float
    stribeck: float  # v_s, rad/s
    viscous: float

    def slope(self, step_s: float) -> float:
        """Just after turning back twice the bristles', and the viscous part of a step."""
        return 2 * self.stiffness + self.viscous / step_s

    def torque(self, state: np.ndarray, before: np.ndarray, now: np.ndarray, step_s: float) -> Pair:
        speed = (now - before) / step_s
        drop = np.exp(-((speed / self.stribeck) ** 2))
        limit = (self.coulomb + (self.stiction - self.coulomb) * drop) / self.stiffness
        after = _slid(state, now - before, limit)
        return self.stiffness * after + self.viscous * speed, after


@dataclass(frozen=True)
class ImpactDamping(Backlash):
    """Play with teeth that dissipate as they meet: a dead zone, and beyond it c · depth · speed.

    τ = -k clip(θ, -g, g) + c [|θ| - g]₊ v, after Hunt and Crossley.
    """

    damping: float  # c, N·m·s/rad²

    def slope(self, step_s: float) -> float:
        """k within the gap; beyond, that of a depth like the gap's."""
        return self.stiffness + 2 * self.damping * self.gap / step_s

    def torque(self, state: np.ndarray, before: np.ndarray, now: np.ndarray, step_s: float) -> Pair:
        depth = np.maximum(np.abs(now) - self.gap, 0)
        return self.at(now) + self.damping * depth * (now - before) / step_s, state


@dataclass(frozen=True)
class QuadraticDamping(JointLaw):
    """Torque with the square of the speed, as of oil that is pressed through a gap: τ = c v |v|."""

    damping: float  # N·m·s²/rad²
    fastest: float  # rad/s, for the bound of the slope

    def slope(self, step_s: float) -> float:
        """At the fastest."""
        return 2 * self.damping * self.fastest / step_s

    def torque(self, state: np.ndarray, before: np.ndarray, now: np.ndarray, step_s: float) -> Pair:
        speed = (now - before) / step_s
        return self.damping * speed * np.abs(speed), state


@dataclass(frozen=True)
class Stops(Elastic):
    """A loose part's stops: nothing within ± `gap`, `stiffness` beyond."""

    gap: float

    def at(self, angle: np.ndarray) -> np.ndarray:
        return self.stiffness * (angle - np.clip(angle, -self.gap, self.gap))
