"""How clearly an effect shows in the FRFs: a case that nobody could solve proves nothing."""

from dataclasses import dataclass, replace

import numpy as np

from planner.truth.hits import Hammer
from planner.truth.model import Truth
from planner.truth.scene import Scene
from planner.truth.secret import Secret, frfs

POSES = 3
CLEARLY = 3.0  # times the noise of a single hit's FRF
AT_LEAST = 0.05
LOW, HIGH = 0.4, 2.5  # of the middling peak force


@dataclass(frozen=True)
class Detectability:
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
        return min(seen) > max(AT_LEAST, CLEARLY * self.frf_noise)


def detectability(
    truth: Truth, secret: Secret, other: Truth, concealed: Secret, scene: Scene, hammer: Hammer
) -> Detectability:
    """Compare noise-free hits without (`truth`, `secret`) and with the effect."""
    quiet = replace(hammer, noise=0.0, force_noise=0.0)
    rows = []
    for q in scene.poses[:POSES]:

        def H(
            cell: Truth,
            what: Secret,
            scale: float = 1.0,
            progress: float = 0.0,
            by: Hammer = quiet,
            q: np.ndarray = q,
        ) -> np.ndarray:
            return frfs(cell, what, q, scale * scene.peak_n, by, scene.arm.band_hz, 0, progress)[1]

        plain = H(truth, secret)
        end = 1.0 if concealed.drift else 0.0
        early, late = H(other, concealed), H(other, concealed, progress=end)
        low, high = (
            (H(other, concealed, k) for k in (LOW, HIGH)) if concealed.ports else (early, early)
        )
        noisy = H(truth, secret, by=hammer)
        rows.append(
            (
                _distance(late, plain),
                _distance(high, low),
                _distance(late, early),
                _distance(noisy, plain),
                -_frac(late, plain),
            )
        )
    change, levels, time, noise, frac = (float(v) for v in np.max(rows, axis=0))
    return Detectability(change, levels, time, noise, -frac)


def _distance(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


def _frac(a: np.ndarray, b: np.ndarray) -> float:
    """|aᴴb|² / (aᴴa bᴴb) over all directions and frequencies."""
    return float(np.abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a).real * np.vdot(b, b).real))
