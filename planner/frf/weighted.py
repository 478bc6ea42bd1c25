"""FRFs of hits that differ in strength: each weighs as much as its own noise allows.

H1 weighs hits by the square of their force; where the noise grows with the hit (range of the
analyser, scatter of hand and place) the strongest hit alone decides, and the scatter of three
hits says next to nothing of how well. Here the noise of each record before its pulse gives its
weight, and scatter pooled over lines and channels says how far that is from the truth.
"""

import numpy as np

from planner.frf.estimator import Estimated, Spectra, assembled, estimate, transformed
from planner.frf.frf import Frf
from planner.recording.records import Hit

SMOOTH = 15  # lines
PRIOR = 12.0  # real values of scatter that the pooled level counts for, beside those near a line


def weighted(
    hits: tuple[Hit, ...], band_hz: tuple[float, float], exponential_rate_1_s: float = 0.0
) -> Frf:
    """FRF matrix of one pose, as `estimate`; H1 where records hold no time before the pulse."""
    found = transformed(hits, band_hz, exponential_rate_1_s)
    noise = np.array([s.noise_power for s in found[1]])  # (hits, 3)
    if not np.all(np.isfinite(noise)) or np.any(noise <= 0):
        return estimate(hits, band_hz, exponential_rate_1_s=exponential_rate_1_s)
    return assembled(hits, found, band_hz, exponential_rate_1_s, _column)


def _column(group: list[Spectra]) -> Estimated:
    """FRF, variance, coherence (3, F) of one hit axis, and the share (F,) of the force's noise."""
    force = np.array([s.force for s in group])  # (n, F)
    response = np.array([s.response for s in group])  # (n, 3, F)
    weight = 1 / np.array([s.noise_power for s in group])  # (n, 3)
    power = np.einsum("nr,nf->rf", weight, np.abs(force) ** 2)
    h = np.einsum("nr,nrf,nf->rf", weight, response, force.conj()) / power
    told = np.einsum("nr,nf->nrf", weight, np.abs(force) ** 2) / power  # sums to 1 over hits
    share = np.array([s.force_noise_power for s in group])[:, None] / np.abs(force) ** 2
    shared = np.mean(np.sum(told**2 * share[:, None], axis=0), axis=0)
    alone = 1 / power
    count = len(group)
    coherence = np.full(h.shape, np.nan)
    if count > 1:
        left = response - h[None] * force[:, None]
        expected = 1 / weight[..., None] + np.abs(h) ** 2 * (share * np.abs(force) ** 2)[:, None]
        scatter = np.sum(np.abs(left) ** 2 / expected, axis=0)  # (3, F), mean count − 1
        alone = alone * _level(scatter, count - 1)
        explained = np.abs(h) ** 2 * power
        coherence = explained / (explained + np.einsum("nr,nrf->rf", weight, np.abs(left) ** 2))
    return h, alone + np.abs(h) ** 2 * shared, coherence, shared


def _level(scatter: np.ndarray, degrees: int) -> np.ndarray:
    """Noise (3, F) beside what the records say: near each line, drawn toward the channels' mean."""
    pooled = float(np.mean(scatter)) / degrees
    width = min(SMOOTH, scatter.shape[1])
    kernel, ones = np.ones(width), np.ones(scatter.shape[1])
    lines = np.convolve(ones, kernel, mode="same")
    near = np.array([np.convolve(row, kernel, mode="same") for row in scatter]) / lines / degrees
    # Real values near a line: two a line, of which windows leave about one in four independent.
    values = 2 * degrees * lines / 4
    return (PRIOR * pooled + values * near) / (PRIOR + values)
