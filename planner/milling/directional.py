"""Cutting forces by the teeth's angle: the directional matrices of the regenerative chip.

A tooth's angle φ is counted from the normal (the cut plane's second axis) towards the feed (its
first), as the spindle turns. Its chip is Δx sin φ + Δy cos φ thick beyond the static one, and its
force on the cutter is −K_t along the cut and −K_r inwards times that (Altintas and Budak, CIRP
Annals 44, 1995).
"""

from dataclasses import dataclass

import numpy as np

from planner.milling.cut import Cut

IN_CUT = 1e-9  # rad: what an angle may miss the cut's ends by
AVERAGED = 60  # slices of a helix over which its lag is averaged


@dataclass(frozen=True)
class Coefficients:
    """Cutting coefficients in N/m²: tangential and radial."""

    kt: float
    kr: float

    @classmethod
    def of(cls, cut: Cut) -> "Coefficients":
        """As the cut states them."""
        return cls(cut.kt_n_m2, cut.kr_n_m2)


def chip_direction(phi: np.ndarray) -> np.ndarray:
    """(..., 2): by how much the chip of a tooth at φ (...) grows per displacement (x, y)."""
    return np.stack([np.sin(phi), np.cos(phi)], axis=-1)


def force_direction(phi: np.ndarray, k: Coefficients) -> np.ndarray:
    """(..., 2): force (x, y) on the cutter per area of the chip of a tooth at φ (...), N/m²."""
    s, c = np.sin(phi), np.cos(phi)
    return np.stack([-k.kt * c - k.kr * s, k.kt * s - k.kr * c], axis=-1)


def mean_matrix(cut: Cut, k: Coefficients) -> np.ndarray:
    """(2, 2) in N/m²: force per displacement and depth, averaged over a turn of the spindle.

    Neither pitch nor helix changes it.
    """
    start, end = cut.immersion_rad
    return cut.teeth / (2 * np.pi) * (_integral(end, k) - _integral(start, k))


def _integral(phi: np.ndarray | float, k: Coefficients) -> np.ndarray:
    """(..., 2, 2): ∫ force_direction · chip_directionᵀ dφ from 0 to φ."""
    phi = np.asarray(phi, dtype=float)
    cs, ss = (1 - np.cos(2 * phi)) / 4, phi / 2 - np.sin(2 * phi) / 4
    cc = phi / 2 + np.sin(2 * phi) / 4
    top = np.stack([-k.kt * cs - k.kr * ss, -k.kt * cc - k.kr * cs], axis=-1)
    low = np.stack([k.kt * ss - k.kr * cs, k.kt * cs - k.kr * cc], axis=-1)
    return np.stack([top, low], axis=-2)


def tooth_matrix(cut: Cut, k: Coefficients, tip_rad: np.ndarray, depth_m: float) -> np.ndarray:
    """(..., 2, 2) in N/m²: of one tooth whose tip is at the angles (...), per metre of depth.

    With a helix it is the mean over the depth: its parts lag behind the tip.
    """
    start, end = cut.immersion_rad
    tip = np.asarray(tip_rad, dtype=float)
    lag = cut.lag_rad_m * depth_m
    if lag < IN_CUT:
        inside = (tip >= start - IN_CUT) & (tip <= end + IN_CUT)
        outer = force_direction(tip, k)[..., :, None] * chip_direction(tip)[..., None, :]
        return np.where(inside[..., None, None], outer, 0.0)
    high, low = np.clip(tip, start, end), np.clip(tip - lag, start, end)
    return (_integral(high, k) - _integral(low, k)) / lag


def step_matrices(cut: Cut, k: Coefficients, count: int, depth_m: float) -> np.ndarray:
    """(count, 2, 2) in N/m²: of all teeth, averaged over equal steps of a tooth's period.

    The first step begins where a tooth enters the cut.
    """
    start, end = cut.immersion_rad
    edges = start + np.arange(count + 1) * 2 * np.pi / (cut.teeth * count)
    tips = edges + 2 * np.pi / cut.teeth * np.arange(cut.teeth)[:, None]
    lag, slices = cut.lag_rad_m * depth_m, AVERAGED if cut.lag_rad_m * depth_m > IN_CUT else 1
    lags = lag * (np.arange(slices) + 0.5) / slices
    total = np.zeros((count, 2, 2))
    for behind in lags:
        turned = np.mod(tips[:, :-1] - behind - start, 2 * np.pi) + start
        ahead = turned + np.diff(tips, axis=1)
        for turn in (0.0, 2 * np.pi):
            a, b = (np.clip(angle - turn, start, end) for angle in (turned, ahead))
            total += (_integral(b, k) - _integral(a, k)).sum(axis=0)
    return total / slices / np.diff(edges)[:, None, None]
