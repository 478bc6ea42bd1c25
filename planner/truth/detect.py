"""How clearly an effect shows in the FRFs: in the laboratory one below the noise is not used."""

from dataclasses import dataclass, replace

import numpy as np

from planner.truth.hits import Hammer
from planner.truth.model import Truth
from planner.truth.scene import Scene
from planner.truth.secret import Secret, frfs, once

COMPARED_POSES = 3  # the first ones of the scene
LEAST_NOISE_RATIO = 3.0  # change over the noise of a single hit's FRF
LEAST_CHANGE = 0.05  # of the FRFs, relative
LOW, HIGH = 0.4, 2.5  # of the middling peak force


@dataclass(frozen=True)
class Clarity:
    """Largest differences over some poses, relative to the size of the FRFs within the band.

    change: with to without the effect; level_change and time_change: with it, between the lowest
    and the highest force, and between start and end of the campaign; frf_noise: that of one hit;
    frac: global FRAC of the FRFs with and without (smallest of the poses).
    """

    change: float
    level_change: float
    time_change: float
    frf_noise: float
    frac: float

    def shows(self, in_levels: bool, in_time: bool) -> bool:
        """Whether it stands out from the noise; also over force levels, or over time."""
        seen = [self.change]
        seen += [self.level_change] if in_levels else []
        seen += [self.time_change] if in_time else []
        return min(seen) > max(LEAST_CHANGE, LEAST_NOISE_RATIO * self.frf_noise)


def clarity(
    truth: Truth, secret: Secret, other: Truth, concealed: Secret, scene: Scene, hammer: Hammer
) -> Clarity:
    """Compare noise-free hits without (`truth`, `secret`) and with the effect."""
    quiet = replace(hammer, noise=0.0, force_noise=0.0)
    poses, band, peak = scene.poses[:COMPARED_POSES], scene.arm.band_hz, scene.peak_n
    middling = [once(q, peak) for q in poses]
    plain = frfs(truth, secret, middling, quiet, band)[1]
    noisy = frfs(truth, secret, middling, hammer, band)[1]
    steps = [(1.0, 0.0), (1.0, 1.0), (LOW, 0.0), (HIGH, 0.0)]
    visits = [once(q, k * peak, progress) for k, progress in steps for q in poses]
    early, late, low, high = np.split(frfs(other, concealed, visits, quiet, band)[1], len(steps))
    return Clarity(
        _distance(late, plain),
        _distance(high, low),
        _distance(late, early),
        _distance(noisy, plain),
        min(_frac(a, b) for a, b in zip(late, plain, strict=True)),
    )


def _distance(a: np.ndarray, b: np.ndarray) -> float:
    """Largest over the poses."""
    return float(max(np.linalg.norm(x - y) / np.linalg.norm(y) for x, y in zip(a, b, strict=True)))


def _frac(a: np.ndarray, b: np.ndarray) -> float:
    """|aᴴb|² / (aᴴa bᴴb) over all directions and frequencies."""
    return float(np.abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a).real * np.vdot(b, b).real))
