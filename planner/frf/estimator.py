"""From hits to the FRF matrix of a pose: H1, H2 or Hv with coherence and variance per line.

No window is laid over the responses: what a record lacks because it ends before the decay is
known exactly (`Frf.tail_s`) and is part of the model that is fitted later. The force is taken
from the pulse alone (force window), because between pulses it holds only noise.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.errors import RefusedError
from planner.frf.frf import Frf
from planner.frf.quantities import convert
from planner.recording.records import AXES, FrfRecord, Hit

MARGIN = 1.3  # lines beyond the band, so that modes at its edge are met from both sides
NYQUIST_SHARE = 0.45  # beyond it anti-alias filters act
DROP_DB = 20.0  # of the force spectrum, where the pulse ceases to excite
SMOOTH = 11  # lines over which the variance, which varies slowly, is averaged
RINGING = 32  # samples for which an anti-alias filter rings after the pulse
LEAST_QUIET = 8  # samples before the pulse that tell offset and noise


@dataclass(frozen=True, eq=False)
class Spectra:
    """Transforms of one hit: force (F,), responses (3, F), and the power of their noise."""

    axis: int
    force: np.ndarray
    response: np.ndarray
    force_noise_power: float
    force_window_s: float
    noise_power: np.ndarray  # (3,) of the responses


Transformed = tuple[np.ndarray, list[Spectra], list[tuple[int, int]], list[str]]
# FRF, variance, coherence (3, F) of one hit axis, and the share (F,) of the force's noise.
Estimated = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def estimate(
    hits: tuple[Hit, ...],
    band_hz: tuple[float, float],
    estimator: str = "h1",
    exponential_rate_1_s: float = 0.0,
) -> Frf:
    """FRF matrix of one pose from its hits (any order and number per axis).

    `estimator` is "h1" (noise on the responses), "h2" (noise on the force) or "hv" (both).
    An exponential window e^(−rate·t), t from the pulse, may be laid over force and responses;
    the result is then exactly H at iω + rate, and says so. Raises RefusedError if the hits do
    not fit together.
    """
    if estimator not in ("h1", "h2", "hv"):
        raise ValueError(f"unknown estimator {estimator}")

    def column(group: list[Spectra]) -> Estimated:
        return *_column(group, estimator), _force_share(group)

    found = transformed(hits, band_hz, exponential_rate_1_s)
    return assembled(hits, found, band_hz, exponential_rate_1_s, column)


def assembled(
    hits: tuple[Hit, ...],
    found: Transformed,
    band_hz: tuple[float, float],
    exponential_rate_1_s: float,
    column: Callable[[list[Spectra]], Estimated],
) -> Frf:
    """FRF matrix of hits that were `transformed`, each hit axis estimated by `column`."""
    frequency, spectra, cuts, remarks = found
    shape = (3, 3, frequency.size)
    h, variance = np.full(shape, np.nan + 0j), np.full(shape, np.nan)
    coherence, share = np.full(shape, np.nan), np.full((3, frequency.size), np.nan)
    counts = [0, 0, 0]
    for axis in range(3):
        group = [s for s in spectra if s.axis == axis]
        counts[axis] = len(group)
        if group:
            h[:, axis], variance[:, axis], coherence[:, axis], share[axis] = column(group)
    return Frf(
        frequency,
        h,
        variance,
        coherence,
        (counts[0], counts[1], counts[2]),
        usable(spectra, frequency, band_hz),
        exponential_rate_1_s,
        tuple(remarks),
        tail(hits, cuts),
        share,
        float(np.mean([s.force_window_s for s in spectra])),
    )


def transformed(
    hits: tuple[Hit, ...], band_hz: tuple[float, float], exponential_rate_1_s: float = 0.0
) -> Transformed:
    """Lines (F,) in Hz, spectra of all hits, the samples used of each, remarks.

    Raises RefusedError if the hits do not fit together.
    """
    if not hits:
        raise RefusedError("No usable hit is left at this pose; hit again.")
    rate = hits[0].sampling_rate_hz
    if any(abs(hit.sampling_rate_hz / rate - 1) > 1e-6 for hit in hits):
        raise RefusedError("The hits of this pose have different sampling rates; use one.")
    cuts, remarks = _alignment(hits)
    length = cuts[0][1] - cuts[0][0]
    frequency = np.fft.rfftfreq(length, 1 / rate)
    chosen = (frequency > 0) & (frequency <= min(MARGIN * band_hz[1], NYQUIST_SHARE * rate))
    frequency = frequency[chosen]
    window = _exponential(length, _onset(hits[0]) - cuts[0][0], exponential_rate_1_s / rate)
    spectra = [_spectra(hit, *cut, chosen, window) for hit, cut in zip(hits, cuts, strict=True)]
    return frequency, spectra, cuts, remarks


def _onset(hit: Hit) -> int:
    return int(np.argmax(np.abs(hit.force_n - np.median(hit.force_n))))


def _alignment(hits: tuple[Hit, ...]) -> tuple[list[tuple[int, int]], list[str]]:
    """Sample ranges in which every hit has its pulse at the same place and the same length."""
    onsets = [_onset(hit) for hit in hits]
    before = min(onsets)
    after = min(len(hit.force_n) - onset for hit, onset in zip(hits, onsets, strict=True))
    if after < 64:
        raise RefusedError("A record ends right after its pulse; record longer.")
    longest = max(len(hit.force_n) for hit in hits)
    remarks = []
    if before + after < 0.9 * longest:
        remarks.append("Records of different length were cut to the shortest.")
    return [(onset - before, onset + after) for onset in onsets], remarks


def _exponential(length: int, onset: int, rate_per_sample: float) -> np.ndarray:
    """The window, 1 at the pulse; with rate 0 it is 1 everywhere."""
    return np.exp(-rate_per_sample * (np.arange(length) - onset))


def _spectra(
    hit: Hit, start: int, stop: int, chosen: np.ndarray, exponential: np.ndarray
) -> Spectra:
    force = np.array(hit.force_n[start:stop])
    response = np.array(hit.acceleration_m_s2[:, start:stop])
    peak = int(np.argmax(np.abs(force - np.median(force))))
    first, last = _pulse(force, peak)
    quiet = _quiet(force, peak)
    noise = np.full(3, np.nan)
    if quiet >= LEAST_QUIET:
        force = force - np.mean(force[:quiet])
        response = response - np.mean(response[:, :quiet], axis=1, keepdims=True)
        noise = np.var(response[:, :quiet], axis=1, ddof=1) * np.sum(exponential**2)
    else:
        force = force - np.median(force)
    window = np.zeros(force.size)
    window[first:last] = exponential[first:last]
    response = response * exponential
    sign = hit.sign
    return Spectra(
        hit.axis_index,
        np.fft.rfft(sign * force * window)[chosen],
        np.fft.rfft(response, axis=1)[:, chosen],
        _variance_after(force, last) * float(np.sum(window**2)),
        (last - first) / hit.sampling_rate_hz,
        noise,
    )


def _variance_after(force: np.ndarray, last: int) -> float:
    """Variance of the force once the pulse is over, when it holds only noise (0: no such time)."""
    return float(np.var(force[last:], ddof=1)) if force.size - last >= LEAST_QUIET else 0.0


def _pulse(force: np.ndarray, peak: int) -> tuple[int, int]:
    """Range of samples that holds the pulse and the anti-alias filter's ringing around it."""
    centred = np.abs(force - np.median(force))
    above = np.flatnonzero(centred > 0.1 * centred[peak])
    first = last = peak
    while first - 1 in above:
        first -= 1
    while last + 1 in above:
        last += 1
    margin = RINGING + 3 * (last - first + 1)
    return max(0, first - margin), min(force.size, last + 1 + margin)


def _quiet(force: np.ndarray, peak: int) -> int:
    """Samples at the start in which nothing has happened yet."""
    centred = np.abs(force - np.median(force))
    level = max(0.01 * centred[peak], 5 * 1.4826 * float(np.median(centred)))
    return max(0, int(np.argmax(centred > level)) - 4)


def _column(group: list[Spectra], estimator: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """FRF, variance and coherence (3, F) of one hit axis."""
    force = np.array([s.force for s in group])  # (n, F)
    response = np.array([s.response for s in group])  # (n, 3, F)
    sff = np.sum(np.abs(force) ** 2, axis=0)
    sxx = np.sum(np.abs(response) ** 2, axis=0)
    sxf = np.sum(response * force.conj()[:, None], axis=0)
    h1 = sxf / sff
    if estimator == "h1":
        h = h1
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            h2 = np.where(np.abs(sxf) > 0, sxx / sxf.conj(), h1)
        # The geometric mean of H1 and H2 (they share the phase) is Hv for equal relative noise.
        h = h2 if estimator == "h2" else h1 * np.sqrt(np.abs(h2) / np.maximum(np.abs(h1), 1e-300))
    n = len(group)
    if n == 1:
        noise = group[0].noise_power
        return h, noise[:, None] / sff[None, :], np.full(h.shape, np.nan)
    # Noise may grow with the hit: each hit counts with its own error (White's estimator, HC2).
    share = np.abs(force) ** 2 / sff
    error = np.abs(response - h[None] * force[:, None]) ** 2 / np.maximum(1 - share, 1e-6)[:, None]
    variance = sum(_smooth(e) * s for e, s in zip(error, share, strict=True)) / sff
    coherence = np.clip(np.abs(sxf) ** 2 / np.maximum(sff * sxx, 1e-300), 0.0, 1.0)
    return h, np.asarray(variance), coherence


def _force_share(group: list[Spectra]) -> np.ndarray:
    """E|δF|²/|F|² (F,) of one column: what noise of the force leaves of the scale's certainty."""
    power = np.array([np.abs(s.force) ** 2 for s in group])
    noise = np.array([s.force_noise_power for s in group])
    return noise @ power / np.sum(power, axis=0) ** 2


def _smooth(values: np.ndarray) -> np.ndarray:
    """Running mean over SMOOTH lines, shorter at the ends; (k, F)."""
    width = min(SMOOTH, values.shape[1])
    kernel = np.ones(width)
    count = np.convolve(np.ones(values.shape[1]), kernel, mode="same")
    return np.array([np.convolve(row, kernel, mode="same") for row in values]) / count


def usable(
    spectra: list[Spectra], frequency: np.ndarray, band_hz: tuple[float, float]
) -> tuple[float, float]:
    """From the first line to where the weakest pulse has lost DROP_DB, or the lines end."""
    high = float(frequency[-1])
    for s in spectra:
        size = np.abs(s.force)
        weak = (size < np.max(size) * 10 ** (-DROP_DB / 20)) & (frequency > band_hz[0])
        if weak.any():
            high = min(high, float(frequency[np.argmax(weak)]))
    return float(frequency[0]), high


def tail(hits: tuple[Hit, ...], cuts: list[tuple[int, int]]) -> float:
    """Time from the centroid of the pulse to the end of the records, mean over the hits.

    Never left out: what looks quiet beside a loud stiff mode may be a soft one that still rings.
    """
    times = []
    for hit, (start, stop) in zip(hits, cuts, strict=True):
        force = hit.force_n[start:stop] - np.median(hit.force_n)
        first, last = _pulse(force, int(np.argmax(np.abs(force))))
        pulse = np.clip(force[first:last], 0.0, None)
        centroid = first + float(np.sum(np.arange(pulse.size) * pulse) / np.sum(pulse))
        # A sample stands for the time around it: the last one ends half a step after itself.
        times.append((stop - start - 0.5 - centroid) / hit.sampling_rate_hz)
    return float(np.mean(times))


def from_records(records: tuple[FrfRecord, ...]) -> Frf:
    """FRF matrix from exported FRFs. Raises RefusedError where they do not make one."""
    first = records[0]
    frequency = np.asarray(first.frequency_hz, dtype=float)
    keep = frequency > 0
    shape = (3, 3, int(keep.sum()))
    h, coherence = np.full(shape, np.nan + 0j), np.full(shape, np.nan)
    for record in records:
        if record.quantity == "unknown" or not record.unit:
            raise RefusedError(
                f"{record.source}: it is not stated whether these FRFs are accelerance, mobility "
                f"or receptance, and in which unit; label them."
            )
        if len(record.frequency_hz) != len(frequency) or not np.allclose(
            record.frequency_hz, frequency
        ):
            raise RefusedError(f"{record.source} has other frequency lines; export one grid.")
        values = convert(frequency, record.values, record.quantity, "accelerance")
        for k, (i, j) in enumerate(
            zip(record.response_direction, record.reference_direction, strict=True)
        ):
            if not (1 <= abs(i) <= 3 and 1 <= abs(j) <= 3):
                raise RefusedError(
                    f"{record.source}: FRF {k + 1} does not state its directions; label them."
                )
            at = abs(i) - 1, abs(j) - 1
            h[at] = np.sign(i) * np.sign(j) * values[k][keep]
            coherence[at] = record.coherence[k][keep]
    measured = [bool(np.all(np.isfinite(h[:, j]))) for j in range(3)]
    if not any(measured):
        raise RefusedError(
            f"{first.source}: no hit axis has all three responses "
            f"({', '.join(AXES)}); export them together."
        )
    for j in range(3):
        if not measured[j]:
            h[:, j] = np.nan
    counts = tuple(int(m) for m in measured)
    unknown = np.full(shape, np.nan)
    band = float(frequency[keep][0]), float(frequency[keep][-1])
    return Frf(frequency[keep], h, unknown, coherence, (counts[0], counts[1], counts[2]), band)
