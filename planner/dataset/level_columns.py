"""Columns of the FRF matrix, per force level, on one common grid of lines."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from planner.recording.force_levels import peak_n
from planner.recording.records import Hit

AROUND = 32  # samples around the pulse in which the anti-alias filter rings
SHARE = 0.02  # of the peak: what belongs to the pulse
DROP = 0.1  # of the force spectrum's top: below it the pulse does not excite


@dataclass(frozen=True, eq=False)
class Column:
    """Accelerance (3, F) in m/s²/N along hit `axis` at one force `level`, at s = iω + `rate_1_s`.

    `variance` (3, F) is E|δH|², ∞ where the pulse does not excite. `peak_n` is the mean peak.
    """

    axis: int
    level: int
    peak_n: float
    frequency_hz: np.ndarray
    accelerance: np.ndarray
    variance: np.ndarray
    rate_1_s: float
    force: np.ndarray  # (F,) in N·s: of one hit, time being 0 at its peak
    hits: tuple[Hit, ...]


class Pulse(NamedTuple):
    """Samples of a hit: where the pulse's neighbourhood begins and ends, and its peak."""

    first: int
    peak: int
    last: int


def pulse(hit: Hit) -> Pulse:
    """Where the pulse of a hit lies."""
    force = np.abs(hit.force_n - np.median(hit.force_n))
    peak = int(np.argmax(force))
    noise = 1.4826 * float(np.median(force))
    small = force < max(SHARE * force[peak], 4 * noise)
    before = np.flatnonzero(small[:peak])
    after = np.flatnonzero(small[peak:])
    first = int(before[-1]) if len(before) else 0
    last = peak + int(after[0]) if len(after) else len(force) - 1
    return Pulse(max(0, first - AROUND), peak, min(len(force), last + AROUND))


def quiet(hit: Hit, at: Pulse) -> int:
    """Samples before anything happens."""
    force = np.abs(hit.force_n - np.median(hit.force_n))
    rising = int(np.argmax(force[: at.peak + 1] > SHARE * force[at.peak]))
    return max(0, rising - 3)


def column(
    hits: tuple[Hit, ...],
    axis: int,
    level: int,
    length: int,
    band_hz: tuple[float, float],
    laid_1_s: float,
    carried_1_s: float,
) -> Column:
    """H1 of hits along one axis; an exponential window of rate `laid_1_s` is laid over both sides.

    The noise is what is heard before the pulse; it is smaller after it where the records carry a
    window of rate `carried_1_s` already.
    """
    rate = hits[0].sampling_rate_hz
    frequency = np.fft.rfftfreq(length, 1 / rate)
    lines = (frequency >= max(band_hz[0], 1e-9)) & (frequency <= band_hz[1])
    found = [_spectrum(hit, length, lines, laid_1_s, carried_1_s) for hit in hits]
    force = np.array([f for f, *_ in found])
    response = np.array([a for _, a, *_ in found])
    sff = np.sum(np.abs(force) ** 2, axis=0)
    h = np.sum(response * force.conj()[:, None], axis=0) / sff
    power = np.abs(force)[:, None] ** 2
    on_response = np.sum(np.array([p for *_, p, _ in found])[:, :, None] * power, axis=0)
    on_force = np.sum(np.array([p for *_, p in found])[:, None, None] * power, axis=0)
    variance = (on_response + np.abs(h) ** 2 * on_force) / sff**2
    weak = np.min(np.abs(force) / np.max(np.abs(force), axis=1, keepdims=True), axis=0) < DROP
    variance[:, weak] = np.inf
    peak = float(np.mean([peak_n(hit) for hit in hits]))
    total = laid_1_s + carried_1_s
    line = np.exp(2j * np.pi * frequency[lines] * pulse(hits[0]).peak / rate) / rate
    return Column(axis, level, peak, frequency[lines], h, variance, total, force[0] * line, hits)


def _spectrum(
    hit: Hit, length: int, lines: np.ndarray, laid_1_s: float, carried_1_s: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Force (F,), responses (3, F), and the powers of their noise (3,) and ()."""
    at = pulse(hit)
    rest = quiet(hit, at)
    n = len(hit.force_n)
    t = (np.arange(n) - at.peak) / hit.sampling_rate_hz
    window = np.exp(-laid_1_s * t)
    still = np.exp(-2 * carried_1_s * np.maximum(t, 0)) * window**2
    enough = rest >= 8
    offset = hit.acceleration_m_s2[:, :rest].mean(axis=1) if enough else np.zeros(3)
    noise = hit.acceleration_m_s2[:, :rest].var(axis=1, ddof=1) if enough else _floor(hit)
    near = np.zeros(n)
    near[at.first : at.last] = 1
    # A window that the records carry has made the noise after the pulse smaller than it was.
    aside = (hit.force_n * np.exp(carried_1_s * np.maximum(t, 0)))[near == 0]
    level = np.median(hit.force_n[:rest]) if enough else np.median(hit.force_n)
    force = np.fft.rfft(hit.sign * (hit.force_n - level) * near * window, length)[lines]
    a = np.fft.rfft((hit.acceleration_m_s2 - offset[:, None]) * window, length, axis=1)[:, lines]
    share = float(np.var(aside, ddof=1)) if len(aside) > 8 else 0.0
    return force, a, noise * float(still.sum()), share * float(np.sum(near * window**2))


def _floor(hit: Hit) -> np.ndarray:
    """Noise variance (3,) where nothing was recorded before the pulse: of the record's end."""
    return np.var(hit.acceleration_m_s2[:, -64:], axis=1)
