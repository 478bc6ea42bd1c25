"""The plan of hits of a case, how each misses, and the force over time."""

from dataclasses import dataclass

import numpy as np

OVER = 8  # steps of the fine grid to a sample
PRETRIGGER = 0.06  # share of the record before the pulse


@dataclass(frozen=True)
class Hit:
    """One hit: pose number, axis 0 to 2 of tcp, sign, level's number, repeat within the axis.

    `tilt` (rad) and `offset` (m) are 3-vectors across the axis; peak N, width s, `power`, `lean`
    the pulse's shape; `order` counts hits of the campaign from 0.
    """

    pose: int
    axis: int
    sign: int
    level: int
    repeat: int
    tilt: np.ndarray
    offset: np.ndarray
    peak: float
    width: float
    power: float
    lean: float
    order: int

    @property
    def name(self) -> str:
        """Signed axis as the table has it."""
        return ("+" if self.sign > 0 else "-") + "xyz"[self.axis]

    @property
    def nominal(self) -> np.ndarray:
        """Unit wrench (6) of a hit that does not miss."""
        wrench = np.zeros(6)
        wrench[self.axis] = self.sign
        return wrench

    @property
    def wrench(self) -> np.ndarray:
        """Wrench (6) at the tcp per N: [d, o x d] with d the true direction."""
        direction = self.nominal[:3] + self.tilt
        direction /= np.linalg.norm(direction)
        return np.concatenate([direction, np.cross(self.offset, direction)])


@dataclass(frozen=True)
class Clock:
    """Sampling rate (Hz) and samples of a record."""

    rate: float
    samples: int

    @property
    def trigger(self) -> float:
        """When the pulse begins (s)."""
        return PRETRIGGER * self.samples / self.rate


def draw_clock(rng: np.random.Generator) -> Clock:
    """512 to 2048 Hz, records of 2 to 4 s."""
    rate = float(rng.choice([512, 640, 800, 1024, 1280, 1600, 2048]))
    return Clock(rate, round(rate * float(rng.choice([2.0, 2.5, 3.2, 4.0]))))


def _heavy(rng: np.random.Generator, size: int = 3) -> np.ndarray:
    """Student's t with 4 degrees of freedom, scaled to rms 1."""
    return rng.standard_t(4, size) / np.sqrt(2)


def draw_hits(rng: np.random.Generator, poses: int, payload: float, rate: float) -> list[Hit]:
    """All hits in the order of recording: three axes a pose, levels and repeats as they come."""
    angle, place = np.radians(rng.uniform(1, 2)), rng.uniform(0.003, 0.006)
    top = 150 * (payload / 20) ** 0.4 * rng.uniform(0.6, 1.6)
    width = max(rng.uniform(0.0025, 0.007), 1.6 / rate)
    signs = rng.choice([-1, 1], 3)
    hits: list[Hit] = []
    for pose in range(poses):
        aim = 0.5 * angle * _heavy(rng), 0.5 * place * _heavy(rng)
        levels = [rng.choice([0.3, 0.45, 0.6]), 1.0, rng.choice([1.8, 2.4])]
        if rng.random() < 0.5:
            levels = levels[:2]
        if rng.random() < 0.15:
            levels = [1.0]
        repeats = 1 if len(levels) == 3 or rng.random() < 0.4 else 2
        if len(levels) == 1:
            repeats = int(rng.integers(2, 4))
        for axis in rng.permutation(3):
            across = np.arange(3) != axis
            for number in range(len(levels) * repeats):
                level = number // repeats
                peak = top * levels[level] * np.exp(0.12 * rng.normal())
                hits.append(Hit(
                    pose, int(axis), int(signs[axis]), level + 1, number + 1,
                    (aim[0] + angle * _heavy(rng)) * across,
                    (aim[1] + place * _heavy(rng)) * across,
                    float(peak), float(width * np.exp(0.08 * rng.normal()) * (peak / top) ** -0.08),
                    float(rng.uniform(0.9, 1.7)), float(rng.uniform(-0.25, 0.35)), len(hits),
                ))  # fmt: skip
    return hits


def pulse(hit: Hit, clock: Clock, over: int = OVER) -> np.ndarray:
    """Force (N) on the fine grid: sin(pi u)^power with u leaned to one side."""
    t = np.arange(clock.samples * over) / (clock.rate * over)
    x = np.clip((t - clock.trigger) / hit.width, 0, 1)
    leaned = x + hit.lean * x * (1 - x)
    return hit.peak * np.sin(np.pi * np.clip(leaned, 0, 1)) ** hit.power
