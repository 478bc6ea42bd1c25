"""Torques of joints that are not linear, beside the linear spring: two numbers k and a each.

`slow` is the equivalent complex stiffness in steady vibration of an amplitude (the describing
function; Worden & Tomlinson 2001, chapter 3), `step` the torque in the course of time. Angles are
in rad, k in N·m/rad; a is the angle at which the law bends.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

LEAST_SHARE = 1e-3  # of k in the joint's linear stiffness where its logarithm is fitted
PHASES = 2 * np.pi * (np.arange(64) + 0.5) / 64

# Names and units of the laws' numbers at joints that slide.
SLIDING = {
    ("stiffness_change", "N·m/rad"): ("stiffness_change", "N/m"),
    ("presliding_stiffness", "N·m/rad"): ("presliding_stiffness", "N/m"),
    ("lost_stiffness", "N·m/rad"): ("lost_stiffness", "N/m"),
    ("coulomb_torque", "N·m"): ("coulomb_force", "N"),
    ("angle", "rad"): ("shift", "m"),
    ("half_gap", "rad"): ("half_gap", "m"),
}

Torque = tuple[Any, Any, Any]  # torque, its slope, new state
Step = Callable[[Any, Any, Any, Any, Any, Any], Torque]


@dataclass(frozen=True)
class Law:
    """`step(xp, k, a, state, before, now)` tells what a motion from `before` to `now` does.

    `xp` is the array library, numpy or jax.numpy. The state is 0 at rest, of backlash how far
    from the middle of the gap the weight holds the joint then, in its unit. `signed`: k may be
    negative. `least_share` bounds k from below in shares of the joint's linear stiffness,
    `most_share` from above.
    """

    effect: str
    step: Step
    signed: bool
    least_share: float
    most_share: float
    names: tuple[tuple[str, str], tuple[str, str]]

    def names_at(self, slides: bool) -> tuple[tuple[str, str], ...]:
        """Names and units of the two numbers, at a joint that `slides` in N and m."""
        return tuple(SLIDING.get(pair, pair) for pair in self.names) if slides else self.names

    @property
    def remembers(self) -> bool:
        """Whether the torque depends on how the joint came to its angle; then it is k times z."""
        return self.effect == "friction"

    def share_bounds(self, sign: int) -> tuple[float, float]:
        """Least and greatest share of k in the joint's stiffness; logarithms where `sign` is ±1."""
        if not sign:
            return self.least_share, self.most_share
        most = self.most_share if sign > 0 else -self.least_share
        return float(np.log(LEAST_SHARE)), float(np.log(most))

    def slow(self, amplitude: np.ndarray, a: float) -> np.ndarray:
        """Equivalent stiffness per unit of k, same shape as `amplitude`; the loss is imaginary."""
        wave = amplitude[..., None] * np.cos(PHASES)
        torque = self._steady(wave, amplitude, a)
        cosine = np.mean(torque * np.cos(PHASES), axis=-1)
        sine = np.mean(torque * np.sin(PHASES), axis=-1)
        return 2 * (cosine - 1j * sine) / amplitude

    def _steady(self, wave: np.ndarray, amplitude: np.ndarray, a: float) -> np.ndarray:
        if not self.remembers:
            one, state = np.ones(()), np.zeros(wave.shape)
            return self.step(np, one, np.asarray(a), state, wave, wave)[0]
        # Dahl's loop closes where the state at the turning points is ± a tanh(A / a).
        top = a * np.tanh(amplitude / a)[..., None]
        falling = np.sin(PHASES) > 0
        way = np.where(falling, amplitude[..., None] - wave, amplitude[..., None] + wave)
        end = np.where(falling, -a, a)
        return end + (np.where(falling, top, -top) - end) * np.exp(-way / a)


def _stiffening(xp: Any, k: Any, a: Any, state: Any, before: Any, now: Any) -> Torque:
    """Secant stiffness 0 at small angles, k at large ones, half of it at a."""
    share = now**2 / (now**2 + a**2)
    return k * now * share, k * share * (3 - 2 * share), state


def _dead_zone(xp: Any, k: Any, a: Any, state: Any, before: Any, now: Any) -> Torque:
    """Within ± a of the middle the spring lacks k; the state is where it rests."""
    there = now + state
    lacking = xp.clip(there, -a, a) - xp.clip(state, -a, a)
    return -k * lacking, xp.where(xp.abs(there) < a, -k, 0.0), state


def _dahl(xp: Any, k: Any, a: Any, state: Any, before: Any, now: Any) -> Torque:
    """Dahl 1968: dz/dθ = 1 − sgn(dθ) z / a, torque k z; exact along a motion one way."""
    way = now - before
    end = xp.where(way >= 0, a, -a)
    rest = (state - end) * xp.exp(-xp.abs(way) / a)
    after = end + rest
    return k * after, k * xp.abs(rest) / a, after


LAWS = (
    Law(
        "nonlinear_stiffness",
        _stiffening,
        True,
        -0.95,
        20.0,
        (("stiffness_change", "N·m/rad"), ("angle", "rad")),
    ),
    Law(
        "friction",
        _dahl,
        False,
        1e-3,
        20.0,
        (("presliding_stiffness", "N·m/rad"), ("coulomb_torque", "N·m")),
    ),
    Law(
        "backlash",
        _dead_zone,
        False,
        1e-3,
        0.99,
        (("lost_stiffness", "N·m/rad"), ("half_gap", "rad")),
    ),
)


def behaviour(effect: str, k: float) -> str:
    """What a joint does that follows a law with this k, for a sentence."""
    return {
        "friction": "sticks and slides: presliding friction",
        "backlash": "has play",
        "nonlinear_stiffness": f"grows {'stiffer' if k > 0 else 'softer'} as it swings",
    }[effect]
