"""Where FRFs and a simulation differ: frequencies, poses, directions, time, joint angles."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import spearmanr

from planner.diagnosis.linear.fit import Fit
from planner.recording.records import AXES

BINS = 64  # of the band
HELD = 0.8  # share of all that is beyond the noise, which what is named holds
CLEAR = 2.0  # χ² per value from which anything is named
CHANCE = 0.01  # of a correlation with time or angles by accident


@dataclass(frozen=True, eq=False)
class Located:
    """χ² per value (1 is the noise) of a fit, seen from several sides; NaN where nothing is known.

    map (n, B) by visit and frequency bin, `edges_hz` (B + 1,); by_visit (n,); by_direction (3, 3)
    by response and hit axis; by_line (B,). `frac` (n, 3, 3) is the FRF assurance criterion.
    `with_time` and `with_angle` (dof,) are rank correlations of by_visit with the order of
    recording and with |angle from the middle|, sin and cos of each joint (largest), 0 where they
    may be chance.
    """

    edges_hz: np.ndarray
    map: np.ndarray
    by_visit: np.ndarray
    by_line: np.ndarray
    by_direction: np.ndarray
    frac: np.ndarray
    with_time: float
    with_angle: np.ndarray
    bands_hz: tuple[tuple[float, float], ...]
    poses: tuple[str, ...]
    directions: tuple[str, ...]

    @property
    def where(self) -> dict[str, list]:
        """As the contract's answer has it."""
        return {
            "bands_hz": [list(band) for band in self.bands_hz],
            "poses": list(self.poses),
            "directions": list(self.directions),
        }


def locate(fit: Fit, poses: Sequence[str], order: np.ndarray | None = None) -> Located:
    """Compare the fit's FRFs with the measured ones, whose poses have these names.

    `order` (n,) is the visits' order in time; without it, that of the data.
    """
    misfit, measured = fit.misfit, fit.misfit.measured
    h = misfit.response(fit.x)[0]
    used = measured.used
    apart = np.where(used, np.abs(h - measured.accelerance) / np.where(used, measured.sd, 1.0), 0)
    square, count = apart**2, used.astype(float)
    total = _ratio(square.sum(axis=(1, 2, 3)), count.sum(axis=(1, 2, 3)))
    directions = _ratio(square.sum(axis=(0, 3)), count.sum(axis=(0, 3)))
    edges = np.linspace(measured.frequency_hz.min(), measured.frequency_hz.max(), BINS + 1)
    place = np.clip(np.digitize(measured.frequency_hz, edges) - 1, 0, BINS - 1)
    sums, counts = np.zeros((len(h), BINS)), np.zeros((len(h), BINS))
    for i, at in enumerate(place):
        np.add.at(sums[i], at, square[i].sum(axis=(0, 1)))
        np.add.at(counts[i], at, count[i].sum(axis=(0, 1)))
    lines = _ratio(sums.sum(axis=0), counts.sum(axis=0))
    order = np.arange(len(h)) if order is None else order
    names = [poses[i] for i in _holding(total)]
    axes = np.nansum(directions, axis=0) + np.nansum(directions, axis=1)
    return Located(
        edges,
        _ratio(sums, counts),
        total,
        lines,
        directions,
        _frac(h, measured.accelerance, used),
        _correlation(total, [np.asarray(order, dtype=float)]),
        np.array([_correlation(total, _waves(angle)) for angle in misfit.setting.q.T]),
        _bands(edges, lines),
        tuple(dict.fromkeys(names)),
        tuple(AXES[i] for i in sorted(_holding(axes / 6))),
    )


def _ratio(total: np.ndarray, count: np.ndarray) -> np.ndarray:
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _holding(values: np.ndarray) -> list[int]:
    """The largest that together hold most of what is beyond the noise; none if all is noise."""
    over = np.nan_to_num(np.maximum(values - 1, 0.0))
    if not np.any(np.nan_to_num(values) > CLEAR):
        return []
    order = np.argsort(-over)
    enough = int(np.searchsorted(np.cumsum(over[order]), HELD * over.sum())) + 1
    return sorted(int(i) for i in order[:enough])


def _bands(edges_hz: np.ndarray, lines: np.ndarray) -> tuple[tuple[float, float], ...]:
    """Intervals that hold most of what is beyond the noise; gaps of one bin are closed."""
    bands: list[tuple[int, int]] = []
    for i in _holding(lines):
        if bands and i - bands[-1][1] <= 2:
            bands[-1] = bands[-1][0], i
        else:
            bands.append((i, i))
    return tuple((float(edges_hz[i]), float(edges_hz[j + 1])) for i, j in bands)


def _frac(h: np.ndarray, measured: np.ndarray, used: np.ndarray) -> np.ndarray:
    """|Σ a* b|² / (Σ|a|² Σ|b|²) over lines, by visit and direction."""
    a, b = np.where(used, h, 0), np.where(used, measured, 0)
    power = np.sum(np.abs(a) ** 2, axis=3) * np.sum(np.abs(b) ** 2, axis=3)
    alike = np.abs(np.sum(a.conj() * b, axis=3)) ** 2
    return alike / np.where(power > 0, power, np.nan)


def _waves(angle: np.ndarray) -> list[np.ndarray]:
    return [np.sin(angle), np.cos(angle), np.abs(angle - np.mean(angle))]


def _correlation(values: np.ndarray, along: list[np.ndarray]) -> float:
    """The largest rank correlation, 0 where it may be chance (Bonferroni)."""
    best = 0.0
    if len(values) < 4 or np.ptp(values) == 0:
        return best
    for one in along:
        if np.ptp(one) < 1e-6:
            continue
        found = spearmanr(values, one)
        if found.pvalue * len(along) < CHANCE and abs(found.statistic) > abs(best):
            best = float(found.statistic)
    return best
