"""Zeroth order: the cutting force's average over a turn, and FRFs as they are.

With eigenvalues λ(ω) of mean matrix times receptance, the limit is b = |1/λ|²/(2 Re 1/λ) at the
tooth period τ with ωτ = π − 2 arg(1/λ) + 2πk (Altintas and Budak, CIRP Annals 44, 1995). Between
lines 1/λ, a dynamic stiffness, is nearly straight: lines may be as coarse as FRFs have them.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Zeroth:
    """Limits at speeds: depth (n,) in m, chatter frequency (n,) in Hz; NaN where never unstable."""

    depth_m: np.ndarray
    chatter_hz: np.ndarray


@dataclass(frozen=True, eq=False)
class LobeCurves:
    """Per line (f,) and eigenvalue (2,): depth of the limit (inf: none) and phase of a period."""

    frequency_hz: np.ndarray
    depth_m: np.ndarray
    phase: np.ndarray

    @property
    def floor_m(self) -> float:
        """The depth that is stable at any speed, inf where nothing is unstable."""
        return float(np.min(self.depth_m, initial=np.inf))

    @property
    def floor_hz(self) -> float:
        """The chatter frequency there."""
        return float(self.frequency_hz[np.argmin(np.min(self.depth_m, axis=1))])


def curves(frequency_hz: np.ndarray, receptance: np.ndarray, mean: np.ndarray) -> LobeCurves:
    """Of receptances (F, 2, 2) in the cut's plane, in m/N, and the mean matrix (2, 2) in N/m²."""
    values = _followed(np.linalg.eigvals(mean @ receptance))
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / values
        depth = np.abs(inverse) ** 2 / (2 * inverse.real)
        depth = np.where((inverse.real > 0) & np.isfinite(depth), depth, np.inf)
    phase = np.unwrap(np.pi - 2 * np.angle(inverse), axis=0)
    return LobeCurves(np.asarray(frequency_hz, dtype=float), depth, phase)


def _followed(values: np.ndarray) -> np.ndarray:
    """Eigenvalues (F, 2) in an order that makes each as continuous as can be."""
    size = np.abs(values).sum(axis=1)
    size[size == 0] = 1.0
    kept = np.abs(np.diff(values, axis=0)).sum(axis=1)
    crossed = np.abs(values[1:, ::-1] - values[:-1]).sum(axis=1)
    swap = np.concatenate([[False], crossed < kept])
    odd = np.cumsum(swap) % 2 == 1
    return np.where(odd[:, None], values[:, ::-1], values)


def limits(found: LobeCurves, rpm: np.ndarray, teeth: int) -> Zeroth:
    """First loss of stability at speeds (n,) in rpm."""
    omega = 2 * np.pi * found.frequency_hz
    depth, hertz = np.full(len(rpm), np.nan), np.full(len(rpm), np.nan)
    for i, speed in enumerate(rpm):
        period = 60 / (speed * teeth)
        for branch in range(2):
            off = (omega * period - found.phase[:, branch]) / (2 * np.pi)
            k = np.floor(off)
            for f in np.flatnonzero(k[1:] != k[:-1]):
                level = max(k[f], k[f + 1])
                share = (level - off[f]) / (off[f + 1] - off[f])
                a, b = found.depth_m[f : f + 2, branch]
                b_here = _between(a, b, share)
                if not b_here >= depth[i]:
                    depth[i] = b_here
                    hertz[i] = found.frequency_hz[f] + share * (
                        found.frequency_hz[f + 1] - found.frequency_hz[f]
                    )
    return Zeroth(
        np.where(np.isfinite(depth), depth, np.nan), np.where(np.isfinite(depth), hertz, np.nan)
    )


def _between(a: float, b: float, share: float) -> float:
    """Depth between two lines; where one of them has none, that of the other is no limit."""
    return a + share * (b - a) if np.isfinite(a) and np.isfinite(b) else np.inf
