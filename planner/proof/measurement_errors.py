"""What every measurement in a cell has: hits beside their axis and point, a chain within tolerance.

Nothing of it is an artefact: each number is what a careful hand, a good sensor and a taught pose
leave. All are drawn anew for each case, from ranges of their own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from planner.proof.deviation import triple
from planner.proof.hits import Hammer, SimulatedHit, largest_rms

RUMBLE_HZ = 2.0, 8.0  # where a workshop's floor vibrates most; chosen


@dataclass(frozen=True, eq=False)
class HitError:
    """How a hit misses: by which vector its unit force errs, and where it lands beside the tcp.

    `direction` (3,) is added to the axis, `offset_m` (3,) is from the tcp; both in its frame.
    """

    direction: np.ndarray = field(default_factory=lambda: np.zeros(3))
    offset_m: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def __add__(self, other: "HitError") -> "HitError":
        return HitError(self.direction + other.direction, self.offset_m + other.offset_m)

    def wrench(self, axis: int) -> np.ndarray:
        """(6,): force and moment about the tcp in m of a unit hit along axis 0, 1 or 2."""
        force = np.eye(3)[axis] + self.direction
        return np.concatenate([force, np.cross(self.offset_m, np.eye(3)[axis])])


EXACT = (HitError(),) * 3  # what hits along x, y and z have in common: nothing


@dataclass(frozen=True)
class MeasurementErrors:
    """Root mean squares of what varies; angles and offsets are those of each of two directions.

    `angle_deg`, `offset_m`: of each hit by itself; `aim_deg`, `aim_m`: common to all hits along an
    axis in the campaign. `readback_deg`: of each joint at each pose. `gain`, `cross_axis`: of the
    sensor's channels and of what each feels of the others. `mounting_deg`, `position_m`: of the
    sensor. `force_gain`: of the hammer. `delay_s`: between force and accelerations. `rumble`: of
    the floor's slow vibration, relative to the response to a middling hit. `heavy`: misses of hits
    have heavy tails (Student's t of 4 degrees of freedom).
    """

    angle_deg: float = 0.0
    offset_m: float = 0.0
    aim_deg: float = 0.0
    aim_m: float = 0.0
    readback_deg: float = 0.0
    gain: float = 0.0
    cross_axis: float = 0.0
    mounting_deg: float = 0.0
    position_m: float = 0.0
    force_gain: float = 0.0
    delay_s: float = 0.0
    rumble: float = 0.0
    heavy: bool = False

    def aims(
        self, axes: Sequence[int], rng: np.random.Generator, common: Sequence[HitError] = EXACT
    ) -> list[HitError]:
        """Of hits along axes 0..2, beside what those along an axis have in common."""
        return [common[a] + self._one(a, self.angle_deg, self.offset_m, rng) for a in axes]

    def common(self, rng: np.random.Generator) -> list[HitError]:
        """What all hits along x, y and z of a campaign have in common, three aims."""
        return [self._one(axis, self.aim_deg, self.aim_m, rng) for axis in range(3)]

    def beside(self, q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Where a robot stands (dof,) in rad whose readback is q."""
        return q + np.deg2rad(self.readback_deg) * rng.standard_normal(len(q))

    def _one(
        self, axis: int, angle_deg: float, offset_m: float, rng: np.random.Generator
    ) -> HitError:
        across = 1.0 - np.eye(3)[axis]
        direction = np.deg2rad(angle_deg) * across * self._spread(rng)
        return HitError(direction, offset_m * across * self._spread(rng))

    def _spread(self, rng: np.random.Generator) -> np.ndarray:
        return rng.standard_t(4, 3) / np.sqrt(2) if self.heavy else rng.standard_normal(3)

    def chain(self, rng: np.random.Generator) -> "MeasuringChain":
        """A measuring chain within its tolerances."""
        turn = Rotation.from_rotvec(np.deg2rad(self.mounting_deg) * rng.standard_normal(3))
        cross = self.cross_axis * rng.standard_normal((3, 3)) * (1 - np.eye(3))
        matrix = (np.diag(1 + self.gain * rng.standard_normal(3)) + cross) @ turn.as_matrix()
        place = triple(self.position_m * rng.standard_normal(3))
        force = 1 + self.force_gain * float(rng.standard_normal())
        delay = abs(self.delay_s * float(rng.standard_normal()))
        return MeasuringChain(matrix, place, force, delay)

    def floor(
        self, hammer: Hammer, hits: Sequence[SimulatedHit], rng: np.random.Generator
    ) -> Hammer:
        """The hammer on a floor that rumbles; `hits` are a campaign's, without noise."""
        if self.rumble == 0:
            return hammer
        size = self.rumble * float(np.median([largest_rms(hit) for hit in hits]))
        most_hz = float(rng.uniform(*RUMBLE_HZ))
        rms = size * abs(float(rng.standard_normal()))
        return replace(hammer, rumble_m_s2=rms, rumble_hz=most_hz)


@dataclass(frozen=True, eq=False)
class MeasuringChain:
    """x' = matrix · x of the accelerations; the sensor sits `offset_m` beside where it is stated.

    The force is shown `force_gain` times as large as it is, accelerations come `delay_s` late.
    """

    matrix: np.ndarray = field(default_factory=lambda: np.eye(3))
    offset_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    force_gain: float = 1.0
    delay_s: float = 0.0


LABORATORY = MeasurementErrors()
EVERYDAY = MeasurementErrors(
    angle_deg=1.5, offset_m=0.004, aim_deg=0.7, aim_m=0.002, readback_deg=0.05, gain=0.015,
    cross_axis=0.01, mounting_deg=1.0, position_m=0.004, force_gain=0.015, delay_s=3e-5,
    rumble=0.01,
)  # fmt: skip
# Of robots that are drawn: more of it.
ROUGH = replace(EVERYDAY, readback_deg=0.07, cross_axis=0.02, position_m=0.006, heavy=True)
