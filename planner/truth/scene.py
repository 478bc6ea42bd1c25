"""What concealed effects are drawn from: the robot's own sizes, and a few distributions."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from planner.truth.arms import Arm
from planner.truth.deviation import Spring
from planner.truth.model import Truth
from planner.truth.secret import Secret

PULSE_S = 0.008  # duration of a middling hit

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

    def stiffness(self, joint: str) -> float:
        """Of a joint about its own axis, in N·m/rad."""
        return float(self.truth.own(joint) @ [spring.stiffness for spring in self.truth.springs])

    def angle(self, joint: str) -> float:
        """A joint's largest elastic angle (rad) under a middling hit; median over some poses."""
        return float(np.median([_swing(self, joint, q) for q in self.poses[:4]]))

    def length(self, number: int) -> np.ndarray:
        """From link `number`'s origin to the next joint's, or the tcp (3,), in m."""
        end = self.arm.joints[number].xyz if number < 6 else self.arm.tcp
        return np.array(end, dtype=float)

    def spring(self, joint: str, axis: np.ndarray, stiffness: float, slide: bool = False) -> Spring:
        """A spring as damped as the robot's own."""
        damping = self.arm.damping_s * stiffness
        return Spring(joint, triple(axis), float(stiffness), float(damping), slide)


@dataclass(frozen=True)
class Drawn:
    """An effect of a case: name and place as a diagnosis states them, true parameters in SI.

    `secret` holds it and all that was there before; `size` as in `Scene`.
    """

    effect: str
    at: str | None
    parameters: Parameters
    secret: Secret
    size: float = 1.0


Draw = Callable[[Scene, Secret, np.random.Generator], Drawn]


def _swing(scene: Scene, joint: str, q: np.ndarray) -> float:
    """Impulse (2/3 of peak × duration) on every mode, amplitudes added up; largest of the axes."""
    poles, shapes, entry, hit, _ = scene.truth.modal(q)
    residues = (scene.truth.own(joint) @ shapes)[:, None] * (entry @ hit.T)
    impulse = 0.6 * scene.peak_n * PULSE_S
    return float(np.max(np.sum(np.abs(residues[poles.imag > 0]), axis=0)) * 2 * impulse)


def triple(values: np.ndarray) -> tuple[float, float, float]:
    """The numbers of a vector (3,)."""
    x, y, z = (float(v) for v in values)
    return x, y, z


def some_direction(rng: np.random.Generator) -> np.ndarray:
    """A unit vector (3,), uniform on the sphere."""
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)


def across(along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors normal to one."""
    along = along / np.linalg.norm(along)
    first = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    first /= np.linalg.norm(first)
    return first, np.cross(along, first)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Log-uniform between two bounds."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def some_joint(rng: np.random.Generator, last: int = 5) -> str:
    """Name of one of the first joints."""
    return f"joint_{rng.integers(1, last + 1)}"


def deviate(secret: Secret, **changes: Iterable) -> Secret:
    """A secret with more items in its deviation, by the name of the field."""
    old = secret.deviation
    more = {name: (*getattr(old, name), *items) for name, items in changes.items()}
    return replace(secret, deviation=replace(old, **more))
