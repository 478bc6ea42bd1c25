"""Laws of springs over the Laplace variable s (1/s): torque per angle, or force per way.

Hysteretic damping is causal here: a ladder of Maxwell branches whose loss factor is even over
1 to 300 Hz,

    d(s) = k_rest + c s + k sum_n g s / (s + w_n),   g = 2 eta D / pi,  D = ln spacing of the w_n,

with k_rest such that the real part of d is k at 20 Hz; stiffness so rises a little with frequency.
"""

from dataclasses import dataclass, replace

import numpy as np

RATES = 2 * np.pi * np.geomspace(0.5, 600.0, 6)  # 1/s, of the branches
SPACING = float(np.log(RATES[1] / RATES[0]))
MIDDLE = 2 * np.pi * 20.0


@dataclass(frozen=True)
class Spring:
    """Stiffness at 20 Hz (N m/rad or N/m), viscous damper (N m s/rad or N s/m), loss factor."""

    stiffness: float
    damping: float = 0.0
    loss: float = 0.0

    @property
    def branch(self) -> float:
        """Stiffness of every Maxwell branch."""
        return self.stiffness * 2 * self.loss * SPACING / np.pi

    @property
    def rest(self) -> float:
        """Stiffness without the branches."""
        return self.stiffness - self.branch * float(np.sum(MIDDLE**2 / (MIDDLE**2 + RATES**2)))

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """Dynamic stiffness at `s`."""
        total = self.rest + self.damping * s
        if self.loss:
            total = total + self.branch * np.sum(s[:, None] / (s[:, None] + RATES), axis=1)
        return total

    def times(self, factor: float) -> "Spring":
        """Stiffness times `factor`; damper and loss factor as they are."""
        return replace(self, stiffness=self.stiffness * factor)


@dataclass(frozen=True)
class Servo:
    """A joint held by a loop: the spring, plus `share` of its stiffness led or lagged.

    d(s) = spring(s) + share k (1 + s/zero) / (1 + s/pole) exp(-s delay); zero, pole in 1/s.
    """

    spring: Spring
    share: float
    zero: float
    pole: float
    delay: float

    @property
    def stiffness(self) -> float:
        """At rest."""
        return self.spring.stiffness * (1 + self.share)

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """Dynamic stiffness at `s`."""
        loop = (1 + s / self.zero) / (1 + s / self.pole) * np.exp(-s * self.delay)
        return self.spring(s) + self.share * self.spring.stiffness * loop


@dataclass(frozen=True)
class FluidDamper:
    """A column of fluid: spring (N/m) in series with damper (N s/m) and inertance (kg).

    d(s) = 1 / (1/k + 1/(c s + b s2))
    """

    spring: float
    damper: float
    inertance: float
    stiffness: float = 0.0

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """Dynamic stiffness at `s`."""
        flow = self.damper * s + self.inertance * s**2
        return self.spring * flow / (self.spring + flow)


@dataclass(frozen=True)
class LateFeedback:
    """Torque in answer to an angle, late: d(s) = gain exp(-s delay) / (1 + s/pole) (N m/rad)."""

    gain: float
    delay: float
    pole: float
    stiffness: float = 0.0

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """Dynamic stiffness at `s`."""
        return self.gain * np.exp(-s * self.delay) / (1 + s / self.pole)
