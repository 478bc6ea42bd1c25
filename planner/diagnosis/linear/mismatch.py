"""How much of the recordings a fit leaves: as it is, and once misses of hits and chain are out."""

from dataclasses import dataclass

import numpy as np

from planner.diagnosis.linear.objective import Misfit


@dataclass(frozen=True, eq=False)
class Mismatch:
    """Mean squares over those of what was recorded: as it is, without misses, and of noise.

    `values` is the number of real values that they were taken of.
    """

    whole: float
    left: float
    noise: float
    values: int

    @property
    def unexplained(self) -> float:
        """Relative size of what is left beyond noise, once the misses are out: 0.03 is 3 %."""
        return float(np.sqrt(max(self.left - self.noise, 0.0)))

    @property
    def resolution(self) -> float:
        """Relative size below which nothing is seen in the noise: one sd of its mean square."""
        return float(np.sqrt(self.noise * np.sqrt(2 / max(self.values, 1))))

    @classmethod
    def of(cls, misfit: Misfit, x: np.ndarray) -> "Mismatch":
        """Of a simulation at x, on the lines of its misfit."""
        whole, left = residuals(misfit, x)
        used = misfit.weight > 0
        unit = 1 / misfit.weight[used]
        recorded = float(np.sum(np.abs(misfit.measured.accelerance[used]) ** 2))
        parts = (np.abs(one[used] * unit) ** 2 for one in (whole, left))
        own = misfit.measured.noise_sd
        noise = 2 * unit**2 if own is None else own[used] ** 2
        sums = [*(float(np.sum(part)) for part in parts), float(np.sum(noise))]
        shares = (value / max(recorded, 1e-300) for value in sums)
        return cls(*shares, values=2 * int(np.count_nonzero(used)))


def residuals(misfit: Misfit, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3, 3, F) in units of the noise (√2 is usual): whole, and once the misses are out.

    The misses are the likeliest ones, pose by pose.
    """
    h = misfit.response(x)[0]
    whole = misfit.weight * (h - misfit.measured.accelerance)
    if misfit.tolerances is None:
        return whole, whole
    around = misfit.around_misses(x)
    return whole, around.left(around.misses())
