"""How uncertain the modes of a cutter are, and samples of them.

What is not known is told mode by mode: natural frequency, damping, size of the residue, each by
itself, and one factor common to all sizes. An FRF's sd says nothing about how errors at one
frequency go with those at another; modes do, for an error of one of them has a shape over all
frequencies. So the modes' sds are those that explain the FRFs' sd best, line by line.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls
from scipy.stats import norm, qmc

from planner.milling.cutter_frf import CutterFrf
from planner.milling.cutter_modes import CutterModes
from planner.milling.directional import Coefficients

STEP = 1e-4  # relative, of derivatives
MOST_LINES = 300  # of an FRF, that its sd is explained at
LEAST_COEFFICIENT = 0.05  # of the stated one: a sample of K_t is not below
MOST_DAMPING = 0.95
LEAST_SHARE = 1e-3  # of the median variance over the lines: none counts as if it were known better
MOST_SD = 0.5  # of ln frequency, damping or size: nothing is known of a mode that is less sure


@dataclass(frozen=True, eq=False)
class ModeSpread:
    """Relative sds (m,) of m modes' frequencies, damping and sizes, and of all sizes together."""

    frequency: np.ndarray
    damping: np.ndarray
    size: np.ndarray
    common: float = 0.0

    @property
    def numbers(self) -> np.ndarray:
        """(3m + 1,) all of them."""
        return np.concatenate([self.frequency, self.damping, self.size, [self.common]])

    @classmethod
    def of(cls, numbers: np.ndarray) -> "ModeSpread":
        """From all of them."""
        frequency, damping, size = np.split(numbers[:-1], 3)
        return cls(frequency, damping, size, float(numbers[-1]))

    @classmethod
    def none(cls, count: int) -> "ModeSpread":
        """Of so many modes of which nothing is uncertain."""
        return cls.of(np.zeros(3 * count + 1))

    @property
    def any(self) -> bool:
        """Whether anything is uncertain."""
        return bool(np.any(self.numbers > 0))


def moved(modes: CutterModes, by: np.ndarray) -> CutterModes:
    """Modes with relative changes (3m + 1,) of `ModeSpread.numbers`; m counts distinct poles.

    A mode keeps its mass where its frequency changes; damping and sizes change by factors e^x.
    """
    _, group = np.unique(modes.poles, return_inverse=True)
    frequency, damping, size = (part[group] for part in np.split(by[:-1], 3))
    omega = np.abs(modes.poles) * np.exp(frequency)
    own = -modes.poles.real / np.abs(modes.poles)
    # A fit may bring a pole that is more damped: that stays, or nothing changed would change it.
    zeta = np.minimum(own * np.exp(damping), np.maximum(own, MOST_DAMPING))
    damped = omega * np.sqrt(1 - zeta**2)
    factor = np.exp(size + by[-1]) * modes.poles.imag / damped
    return replace(
        modes,
        poles=-zeta * omega + 1j * damped,
        shapes=modes.shapes * factor[:, None],
        residual=modes.residual * np.exp(by[-1]),
    )


def explaining(modes: CutterModes, frf: CutterFrf) -> tuple[ModeSpread, float]:
    """Sds that explain those of an FRF, and the share of its variance that they give."""
    count = len(np.unique(modes.poles))
    if frf.sd is None or not np.any(frf.sd > 0):
        return ModeSpread.none(count), 1.0
    every = max(1, len(frf.frequency_hz) // MOST_LINES)
    hertz, sd = frf.frequency_hz[::every], frf.sd[..., ::every].transpose(2, 0, 1)
    here = modes.receptance(hertz)
    columns = []
    for i in range(3 * count + 1):
        by = np.zeros(3 * count + 1)
        by[i] = STEP
        columns.append(np.abs((moved(modes, by).receptance(hertz) - here) / STEP) ** 2)
    scale = np.sum(np.abs(here) ** 2, axis=(1, 2))[:, None, None]
    wanted = sd**2 / scale
    # Line by line alike: few lines of which hardly anything is known say nothing of the others.
    size = np.sum(wanted, axis=(1, 2))[:, None, None]
    size = np.maximum(size, LEAST_SHARE * np.median(size))
    a = np.stack([(column / scale / size).ravel() for column in columns], axis=1)
    wanted = (wanted / size).ravel()
    unit = np.linalg.norm(a, axis=0)
    unit[unit == 0] = np.inf
    square = nnls(a / unit, wanted)[0] / unit
    given = float(np.sum(a @ square) / np.sum(wanted))
    return ModeSpread.of(np.minimum(np.sqrt(square), MOST_SD)), given


def sampled(
    modes: CutterModes, spread: ModeSpread, k: Coefficients, sds: tuple[float, float],
    count: int, seed: int,
) -> list[tuple[CutterModes, Coefficients]]:  # fmt: skip
    """So many samples of modes and coefficients (relative sds of K_t, K_r), a Latin hypercube."""
    numbers = np.append(spread.numbers, sds)
    points = qmc.LatinHypercube(len(numbers), rng=np.random.default_rng(seed)).random(count)
    normal = norm.ppf(points) * numbers
    found = []
    for row in normal:
        kt, kr = 1 + np.maximum(row[-2:], LEAST_COEFFICIENT - 1)
        found.append((moved(modes, row[:-2]), Coefficients(k.kt * kt, k.kr * kr)))
    return found
