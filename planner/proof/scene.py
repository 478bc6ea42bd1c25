"""What concealed effects are drawn from: the robot's own sizes, and a few distributions."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from planner.proof.arms import Arm
from planner.proof.deviation import Spring, triple
from planner.proof.fault_injection import InjectedFaults
from planner.proof.model import Truth

PULSE_S = 0.008  # duration of a middling hit
REFERENCE_HZ = 15.0  # at which speeds of joints are estimated: the middle of the bands

Parameters = dict[str, float | str | list[float]]


@dataclass(frozen=True, eq=False)
class Scene:
    """What the sizes of effects are drawn from; `truth` is the robot without them.

    `size`: every effect's strength relative to a large one (1), down to nothing (0).
    """

    arm: Arm
    truth: Truth
    per_joint: int
    poses: np.ndarray  # (n, 6) rad
    peak_n: float
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

    def some_link(self, rng: np.random.Generator, first: int = 2) -> int:
        """Number of one of the links from `first` on."""
        return int(rng.integers(first, len(self.arm.joints) + 1))

    def ripple(self, rng: np.random.Generator) -> tuple[float, float]:
        """Cosine and sine, at any phase, of a stiffness that goes with an angle."""
        size, phase = self.size * rng.uniform(0.3, 0.6), rng.uniform(0, 2 * np.pi)
        return float(size * np.cos(phase)), float(size * np.sin(phase))

    def compliance(self, port: np.ndarray) -> float:
        """How far a unit force on a port (e,) moves it at the first pose."""
        return float(port @ np.linalg.solve(self.truth.matrices(self.poses[0])[2], port))

    def stiffness(self, joint: str) -> float:
        """Of a joint about its own axis, in N·m/rad."""
        return float(self.truth.own(joint) @ [spring.stiffness for spring in self.truth.springs])

    def angle(self, joint: str) -> float:
        """A joint's largest elastic angle (rad) under a middling hit; median over some poses."""
        return float(np.median([_swing(self, joint, q) for q in self.poses[:4]]))

    def length(self, number: int) -> np.ndarray:
        """From link `number`'s origin to the next joint's, or the tcp (3,), in m."""
        end = self.arm.joints[number].xyz if number < len(self.arm.joints) else self.arm.tcp
        return np.array(end, dtype=float)

    def spring(self, joint: str, axis: np.ndarray, stiffness: float, slide: bool = False) -> Spring:
        """A spring as damped as the robot's own."""
        damping = self.arm.damping_s * stiffness
        return Spring(joint, triple(axis), float(stiffness), float(damping), slide)


@dataclass(frozen=True)
class DrawnEffect:
    """An effect of a case: name and place as a diagnosis states them, true parameters in SI.

    `injected` holds it and all that was there before; `size` as in `Scene`.
    """

    effect: str
    at: str | None
    parameters: Parameters
    injected: InjectedFaults
    size: float = 1.0


Draw = Callable[[Scene, InjectedFaults, np.random.Generator], DrawnEffect]


def _swing(scene: Scene, joint: str, q: np.ndarray) -> float:
    """Impulse (2/3 of peak × duration) on every mode, amplitudes added up; largest of the axes."""
    poles, shapes, entry, hit, _ = scene.truth.modal(q)
    residues = (scene.truth.own(joint) @ shapes)[:, None] * (entry @ hit.T)
    impulse = 0.6 * scene.peak_n * PULSE_S
    return float(np.max(np.sum(np.abs(residues[poles.imag > 0]), axis=0)) * 2 * impulse)


def some_direction(rng: np.random.Generator) -> np.ndarray:
    """A unit vector (3,), uniform on the sphere."""
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Log-uniform between two bounds."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def some_joint(scene: Scene, rng: np.random.Generator, last: int = 5) -> str:
    """Name of one of the first joints."""
    return f"joint_{rng.integers(1, min(last, len(scene.arm.joints)) + 1)}"


def deviate(injected: InjectedFaults, **changes: Iterable) -> InjectedFaults:
    """A secret with more items in its deviation, by the name of the field."""
    old = injected.deviation
    more: dict[str, Any] = {name: (*getattr(old, name), *items) for name, items in changes.items()}
    return replace(injected, deviation=replace(old, **more))
