"""Torques of joints that are not linear, beside the linear spring: two numbers k and a each.

`slow` is the equivalent complex stiffness in steady vibration of an amplitude (the describing
function; Worden & Tomlinson 2001, chapter 3), `step` the torque in the course of time. Angles are
in rad, k in N·m/rad; a is the angle at which the law bends.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

PHASES = 2 * np.pi * (np.arange(64) + 0.5) / 64

Torque = tuple[np.ndarray, np.ndarray, np.ndarray]  # torque, its slope, new state
Step = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray], Torque]


@dataclass(frozen=True)
class Law:
    """`step(k, a, state, before, now)` tells what a motion from `before` to `now` does.

    The state is 0 at rest. `signed`: k may be negative. `least_share` bounds k from below in
    shares of the joint's linear stiffness, `most_share` from above.
    """

    effect: str
    step: Step
    signed: bool
    least_share: float
    most_share: float
    names: tuple[tuple[str, str], tuple[str, str]]

    @property
    def remembers(self) -> bool:
        """Whether the torque depends on how the joint came to its angle; then it is k times z."""
        return self.effect == "friction"

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
            return self.step(one, np.asarray(a), state, wave, wave)[0]
        # Dahl's loop closes where the state at the turning points is ± a tanh(A / a).
        top = a * np.tanh(amplitude / a)[..., None]
        falling = np.sin(PHASES) > 0
        way = np.where(falling, amplitude[..., None] - wave, amplitude[..., None] + wave)
        end = np.where(falling, -a, a)
        return end + (np.where(falling, top, -top) - end) * np.exp(-way / a)


def _stiffening(
    k: np.ndarray, a: np.ndarray, state: np.ndarray, before: np.ndarray, now: np.ndarray
) -> Torque:
    """Secant stiffness 0 at small angles, k at large ones, half of it at a."""
    share = now**2 / (now**2 + a**2)
    return k * now * share, k * share * (3 - 2 * share), state


def _dead_zone(
    k: np.ndarray, a: np.ndarray, state: np.ndarray, before: np.ndarray, now: np.ndarray
) -> Torque:
    """Within ± a the spring lacks k."""
    inside = np.abs(now) < a
    return -k * np.clip(now, -a, a), np.where(inside, -k, 0.0), state


def _dahl(
    k: np.ndarray, a: np.ndarray, state: np.ndarray, before: np.ndarray, now: np.ndarray
) -> Torque:
    """Dahl 1968: dz/dθ = 1 − sgn(dθ) z / a, torque k z; exact along a motion one way."""
    way = now - before
    end = np.where(way >= 0, a, -a)
    rest = (state - end) * np.exp(-np.abs(way) / a)
    after = end + rest
    return k * after, k * np.abs(rest) / a, after


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
