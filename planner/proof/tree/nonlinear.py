"""Nonlinear torques of a gear, in excess of its linear spring (N m); angles in rad, rates in rad/s.

`torque(x, rate, before, memory)` answers (torque, by angle, by rate): `before` is the angle one
step earlier, `memory` the torque then (for laws that remember).
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Softening:
    """k (w tanh(x / w) - x)."""

    stiffness: float
    width: float

    def torque(self, x, _rate, _before, _memory):
        """See the module."""
        t = np.tanh(x / self.width)
        return self.stiffness * (self.width * t - x), -self.stiffness * t**2, 0.0


@dataclass(frozen=True)
class Hardening:
    """k x3 / w2."""

    stiffness: float
    width: float

    def torque(self, x, _rate, _before, _memory):
        """See the module."""
        ratio = (x / self.width) ** 2
        return self.stiffness * ratio * x, 3 * self.stiffness * ratio, 0.0


@dataclass(frozen=True)
class Piecewise:
    """Slope k inside +-w, `slope` k outside, corners rounded over w/10."""

    stiffness: float
    width: float
    slope: float

    def torque(self, x, _rate, _before, _memory):
        """See the module."""
        out, by = _dead_zone(x, self.width, 0.1 * self.width)
        factor = (self.slope - 1) * self.stiffness
        return factor * out, factor * by, 0.0


@dataclass(frozen=True)
class Backlash:
    """A gap of +-w around which the gear hangs at `rest` (rad, one a hit, by gravity's preload)."""

    stiffness: float
    width: float
    rest: np.ndarray

    def torque(self, x, _rate, _before, _memory):
        """k (dz(x + rest) - dz(rest)) - k x."""
        out, by = _dead_zone(x + self.rest, self.width, 0.15 * self.width)
        at_rest, _ = _dead_zone(self.rest, self.width, 0.15 * self.width)
        return self.stiffness * (out - at_rest - x), self.stiffness * (by - 1), 0.0


@dataclass(frozen=True)
class Coulomb:
    """c tanh(rate / v): friction rounded off below v rad/s."""

    limit: float
    rate: float

    def torque(self, _x, rate, _before, _memory):
        """See the module."""
        t = np.tanh(rate / self.rate)
        return self.limit * t, 0.0, self.limit * (1 - t**2) / self.rate


@dataclass(frozen=True)
class Dahl:
    """dT/dx = s (1 - T sgn(dx) / c): presliding stiffness s, limit c; exact over a step."""

    limit: float
    stiffness: float

    def torque(self, x, _rate, before, memory):
        """See the module."""
        way = x - before
        sign = np.sign(way)
        fading = np.exp(-self.stiffness * np.abs(way) / self.limit)
        value = self.limit * sign + (memory - self.limit * sign) * fading
        value = np.where(sign == 0, memory, value)
        return value, self.stiffness * (1 - memory * sign / self.limit) * fading, 0.0


def _dead_zone(x, width, round_off):
    """max(x - w, 0) + min(x + w, 0), corners rounded; and its slope."""
    up, down = np.sqrt((x - width) ** 2 + round_off**2), np.sqrt((x + width) ** 2 + round_off**2)
    return x + (up - down) / 2, 1 + ((x - width) / up - (x + width) / down) / 2


def hanging_at(torque: float, stiffness: float, width: float) -> float:
    """The angle (rad) at which a gear with a gap of +-`width` bears `torque` (N m); bisection."""
    low, high = (
        -width - 2 * abs(torque) / stiffness - width,
        2 * width + 2 * abs(torque) / stiffness,
    )
    for _ in range(80):
        middle = (low + high) / 2
        out, _ = _dead_zone(np.array(middle), width, 0.15 * width)
        low, high = (middle, high) if stiffness * out < torque else (low, middle)
    return (low + high) / 2
