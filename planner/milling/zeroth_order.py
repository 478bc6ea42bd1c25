"""Zeroth order: the cutting force's average over a turn.

With eigenvalues λ(ω) of mean matrix times receptance, the limit is b = |1/λ|²/(2 Re 1/λ) at the
tooth period τ with ωτ = π − 2 arg(1/λ) + 2πk (Altintas and Budak, CIRP Annals 44, 1995). Between
lines 1/λ, a dynamic stiffness, is nearly straight.
"""

from dataclasses import dataclass

import numpy as np

NOTHING = 1e-60  # 1/m: of an eigenvalue


@dataclass(frozen=True, eq=False)
class LobeCurves:
    """Per line (f,) and eigenvalue λ (f, 2): 1/λ in m, depth of the limit (inf: none), phase."""

    frequency_hz: np.ndarray
    inverse: np.ndarray

    @property
    def depth_m(self) -> np.ndarray:
        """(f, 2)."""
        return _depth(self.inverse)

    @property
    def phase(self) -> np.ndarray:
        """(f, 2) of a tooth's period, but for whole turns."""
        return np.unwrap(np.pi - 2 * np.angle(self.inverse), axis=0)

    @property
    def floor_m(self) -> float:
        """The depth that is stable at any speed, inf where nothing is unstable."""
        return float(np.min(self.depth_m, initial=np.inf))

    @property
    def floor_hz(self) -> float:
        """The chatter frequency there."""
        return float(self.frequency_hz[np.argmin(np.min(self.depth_m, axis=1))])


def _depth(inverse: np.ndarray) -> np.ndarray:
    """Of 1/λ in m (…): the depth of the limit, inf where there is none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.abs(inverse) ** 2 / (2 * inverse.real)
    return np.where((inverse.real > 0) & np.isfinite(depth), depth, np.inf)


def curves(frequency_hz: np.ndarray, receptance: np.ndarray, mean: np.ndarray) -> LobeCurves:
    """Of receptances (F, 2, 2) in the cut's plane, in m/N, and the mean matrix (2, 2) in N/m²."""
    values = _followed(np.linalg.eigvals(mean @ receptance))
    # Where nothing gives way in a direction, next to nothing: its depth is beyond all others.
    values = np.where(values == 0, NOTHING, values)
    return LobeCurves(np.asarray(frequency_hz, dtype=float), 1 / values)


def _followed(values: np.ndarray) -> np.ndarray:
    """Eigenvalues (F, 2) in an order that makes each as continuous as can be."""
    size = np.abs(values).sum(axis=1)
    size[size == 0] = 1.0
    kept = np.abs(np.diff(values, axis=0)).sum(axis=1)
    crossed = np.abs(values[1:, ::-1] - values[:-1]).sum(axis=1)
    swap = np.concatenate([[False], crossed < kept])
    odd = np.cumsum(swap) % 2 == 1
    return np.where(odd[:, None], values[:, ::-1], values)


def limits(found: LobeCurves, rpm: np.ndarray, teeth: int) -> tuple[np.ndarray, np.ndarray]:
    """First loss at speeds (n,) in rpm: depth in m, chatter frequency in Hz; NaN where none is.

    Between lines 1/λ is straight.
    """
    hertz, phase = found.frequency_hz, found.phase
    depth, chatter = np.full(len(rpm), np.inf), np.full(len(rpm), np.nan)
    for i, speed in enumerate(rpm):
        turns = hertz[:, None] * 60 / (speed * teeth) - phase / (2 * np.pi)
        low = np.floor(np.fmin(turns[1:], turns[:-1])) + 1
        count = np.floor(np.fmax(turns[1:], turns[:-1])) + 1 - low
        count = np.where(np.isfinite(count), count, 0).astype(int)
        line, branch = np.nonzero(count > 0)
        # Each whole number of turns that is passed between two lines is a lobe's limit.
        each = np.repeat(np.arange(len(line)), count[line, branch])
        order = np.arange(len(each)) - np.searchsorted(each, each)
        line, branch = line[each], branch[each]
        start, step = turns[line, branch], np.diff(turns, axis=0)[line, branch]
        share = (low[line, branch] + order - start) / step
        change = np.diff(found.inverse, axis=0)[line, branch]
        here = _depth(found.inverse[line, branch] + share * change)
        if len(here) and np.isfinite(np.min(here)):
            best = int(np.argmin(here))
            depth[i] = here[best]
            chatter[i] = hertz[line[best]] + share[best] * np.diff(hertz)[line[best]]
    return np.where(np.isfinite(depth), depth, np.nan), chatter
