"""What concealed effects are drawn from: the robot's own sizes, and a few distributions."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from planner.proof.arms import Arm
from planner.proof.deviation import Spring, Vector, triple
from planner.proof.fault_injection import InjectedFaults
from planner.proof.model import Truth

PULSE_S = 0.008  # duration of a middling hit
REFERENCE_HZ = 15.0  # at which speeds of joints are estimated: the middle of the bands


@dataclass(frozen=True, eq=False)
class Scene:
    """A robot and what is concealed in it so far; more is drawn by `rng`.

    `truth` is the robot without any effect. `size`: an effect's strength relative to a large one
    (1), down to nothing (0).
    """

    arm: Arm
    truth: Truth
    per_joint: int
    poses: np.ndarray  # (n, 6) rad
    peak_n: float
    injected: InjectedFaults
    rng: np.random.Generator
    size: float = 1.0

    @property
    def moving_kg(self) -> float:
        """Mass of links and spindle."""
        return sum(body.mass for body in self.arm.bodies[1:])

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints' names."""
        return tuple(f"joint_{n}" for n in range(1, len(self.arm.joints) + 1))

    @property
    def band_of_modes(self) -> tuple[float, float]:
        """Lowest and highest of the first four natural frequencies at the first pose, in Hz."""
        low, *_, high = self.truth.modes(self.poses[0], 4)[0]
        return float(low), float(high)

    def axis(self, joint: str) -> np.ndarray:
        """A joint's axis (3,) in its own frame."""
        return np.array(self.arm.joints[int(joint[-1]) - 1].axis, dtype=float)

    def compliance(self, port: np.ndarray) -> float:
        """How far a unit force on a port (e,) moves it at the first pose."""
        return float(port @ np.linalg.solve(self.truth.matrices(self.poses[0])[2], port))

    def stiffness(self, joint: str) -> float:
        """Of a joint about its own axis, in N·m/rad."""
        return self.truth.stiffness(joint)

    def angle(self, joint: str) -> float:
        """A joint's largest elastic angle (rad) under a middling hit; median over some poses."""
        return float(np.median([self._swing(joint, q) for q in self.poses[:4]]))

    def _swing(self, joint: str, q: np.ndarray) -> float:
        """An impulse (2/3 of peak × duration) on every mode, amplitudes added up; largest axis."""
        poles, shapes, entry, hit, _ = self.truth.modal(q)
        residues = (self.truth.own(joint) @ shapes)[:, None] * (entry @ hit.T)
        impulse = 0.6 * self.peak_n * PULSE_S
        return float(np.max(np.sum(np.abs(residues[poles.imag > 0]), axis=0)) * 2 * impulse)

    def length(self, number: int) -> np.ndarray:
        """From link `number`'s origin to the next joint's, or the tcp (3,), in m."""
        end = self.arm.joints[number].xyz if number < len(self.arm.joints) else self.arm.tcp
        return np.array(end, dtype=float)

    def spring(self, joint: str, axis: np.ndarray, stiffness: float, slide: bool = False) -> Spring:
        """A spring as damped as the robot's own."""
        damping = self.arm.damping_s * stiffness
        return Spring(joint, triple(axis), float(stiffness), float(damping), slide)

    def changed(self, **changes: Any) -> "Scene":
        """With other parts of what is concealed."""
        return replace(self, injected=replace(self.injected, **changes))

    def deviating(self, **changes: Any) -> "Scene":
        """With other parts of the robot's deviation."""
        return self.changed(deviation=replace(self.injected.deviation, **changes))

    def adding(self, **items: Iterable) -> "Scene":
        """With more items in the robot's deviation, by the name of the field."""
        return replace(self, injected=deviate(self.injected, **items))

    def log_uniform(self, low: float, high: float) -> float:
        """Log-uniform between two bounds."""
        return log_uniform(self.rng, low, high)

    def direction(self) -> Vector:
        """A unit vector, uniform on the sphere."""
        return triple(some_direction(self.rng))

    def some_joint(self, last: int = 5) -> str:
        """Name of one of the first joints."""
        return f"joint_{self.rng.integers(1, min(last, len(self.arm.joints)) + 1)}"

    def some_link(self, first: int = 2) -> int:
        """Number of one of the links from `first` on."""
        return int(self.rng.integers(first, len(self.arm.joints) + 1))

    def ripple(self) -> tuple[float, float]:
        """Cosine and sine, at any phase, of a stiffness that goes with an angle."""
        size, phase = self.size * self.rng.uniform(0.3, 0.6), self.rng.uniform(0, 2 * np.pi)
        return float(size * np.cos(phase)), float(size * np.sin(phase))


Parameters = dict[str, float | str | list[float]]
# Place as a diagnosis states it (none, where the library has no name), true parameters in SI,
# and the scene with the effect.
Drawn = tuple[str | None, Parameters, Scene]
Draw = Callable[[Scene], Drawn]


def some_direction(rng: np.random.Generator) -> np.ndarray:
    """A unit vector (3,), uniform on the sphere."""
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Log-uniform between two bounds."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def deviate(injected: InjectedFaults, **changes: Iterable) -> InjectedFaults:
    """A secret with more items in its deviation, by the name of the field."""
    old = injected.deviation
    more: dict[str, Any] = {name: (*getattr(old, name), *items) for name, items in changes.items()}
    return replace(injected, deviation=replace(old, **more))
