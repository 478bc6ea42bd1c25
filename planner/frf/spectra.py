"""Hits of one pose as spectra on common lines, with the power of the noise in each.

No window is laid over the responses but an exponential one where it is asked for: what a record
lacks because it ends before the decay is known exactly (`Frf.tail_s`) and is part of the model
that is fitted later. The force is taken from the pulse alone (force window), because between
pulses it holds only noise.
"""

from dataclasses import dataclass

import numpy as np

from planner.errors import RefusedError
from planner.recording.records import Hit
from planner.recording.sampling import same_rate

LEAST_QUIET = 8  # samples before the pulse that tell offset and noise
FADED = 1e-3  # of the noise that a window leaves: fainter noise is the digits' own


@dataclass(frozen=True, eq=False)
class Spectra:
    """Spectra of all hits of a pose at lines frequency_hz (F,).

    `tail_s` and `exponential_rate_1_s` as in `Frf`; `peak_s` is the time of the pulses' peaks, the
    same for all hits.
    """

    frequency_hz: np.ndarray
    hits: tuple["HitSpectra", ...]
    tail_s: float
    peak_s: float
    exponential_rate_1_s: float
    remarks: tuple[str, ...]


def window_sum(values: np.ndarray, half: int) -> np.ndarray:
    """Sum of real values (…, F) over so many lines to either side, fewer at the ends."""
    window, lines = np.ones(2 * half + 1), slice(half, half + values.shape[-1])
    return np.apply_along_axis(lambda row: np.convolve(row, window)[lines], -1, values)


def running_mean(values: np.ndarray, half: int) -> np.ndarray:
    """Mean of real values (…, F) over so many lines to either side, fewer at the ends."""
    return window_sum(values, half) / window_sum(np.ones(values.shape[-1]), half)


def transform(
    hits: tuple[Hit, ...],
    band_hz: tuple[float, float],
    laid_1_s: float = 0.0,
    carried_1_s: float = 0.0,
    samples: int = 0,
) -> Spectra:
    """Spectra of hits that are cut so that all pulses lie at the same time.

    `laid_1_s` is the rate in 1/s of an exponential window e^(−rate·t), t from the pulse's peak,
    laid over force and responses here, before the pulse too (there it is above 1): the FRF is then
    exactly H at iω + rate. `carried_1_s` is that of one which is in the records already.
    Records are filled up with zeros to `samples`, where stated, so that poses share their lines.
    Raises RefusedError if the hits do not fit together.
    """
    if not hits:
        raise RefusedError("No usable hit is left at this pose; hit again.")
    rate = hits[0].sampling_rate_hz
    if not all(same_rate(hit, hits[0]) for hit in hits):
        raise RefusedError("The hits of this pose have different sampling rates; use one.")
    # Samples before the peak, and from it on, that every hit has
    before = min(hit.pulse.peak for hit in hits)
    after = min(len(hit.force_n) - hit.pulse.peak for hit in hits)
    if after < 64:
        raise RefusedError("A record ends right after its pulse; record longer.")
    remarks: tuple[str, ...] = ()
    if before + after < 0.9 * max(len(hit.force_n) for hit in hits):
        remarks = ("Records of different length were cut to the shortest.",)
    length = max(before + after, samples)
    frequency = np.fft.rfftfreq(length, 1 / rate)
    # Margin: lines beyond the band, so that modes at its edge are met from both sides
    # Nyquist share: beyond it anti-alias filters act
    chosen = (frequency > 0) & (frequency <= min(1.3 * band_hz[1], 0.45 * rate))
    rates = laid_1_s, carried_1_s
    found = tuple(HitSpectra(hit, before, after, length, chosen, *rates) for hit in hits)
    tail = float(np.mean([_tail(hit, before, after) for hit in hits]))
    return Spectra(frequency[chosen], found, tail, before / rate, sum(rates), remarks)


class HitSpectra:
    """Transforms of one hit: force (F,) in N and responses (r, F) in m/s², summed over samples.

    They are along the `rows` of `layout`. `force_noise` and `noise` (r,) are the powers of the
    noise in them; `noise_known` is False where nothing was recorded before the pulse and `noise` is
    no more than a bound.
    """

    def __init__(
        self, hit: Hit, before: int, after: int, length: int, chosen: np.ndarray, laid_1_s: float,
        carried_1_s: float,
    ) -> None:  # fmt: skip
        self.axis, self.layout, self.rows = hit.axis_index, hit.layout, tuple(hit.rows)
        pulse, samples = hit.pulse, len(hit.force_n)
        start = pulse.peak - before
        used = slice(start, pulse.peak + after)
        t = (np.arange(samples) - pulse.peak) / hit.sampling_rate_hz
        laid = np.exp(-laid_1_s * t)
        # The window that the records carry has made the noise after the pulse smaller than it was.
        carried = np.exp(-carried_1_s * np.maximum(t, 0))
        self.noise_known = pulse.quiet - start >= LEAST_QUIET
        quiet = slice(start, pulse.quiet)
        force, response = hit.force_n - pulse.offset_n, hit.acceleration_m_s2
        if self.noise_known:
            force = force - np.mean(force[quiet])
            response = response - np.mean(response[:, quiet], axis=1, keepdims=True)
        # Last samples of a record: they bound its noise where nothing was recorded before the pulse
        still = response[:, quiet] if self.noise_known else response[:, -64:]
        power = float(np.sum((laid * carried)[used] ** 2))
        self.noise = np.var(still, axis=1, ddof=1) * power
        first, end = pulse.around(samples)
        near = np.zeros(samples)
        near[max(first, start) : end] = 1.0
        self.force_window_s = float(np.sum(near)) / hit.sampling_rate_hz
        aside = (force / np.maximum(carried, FADED))[(near == 0) & (carried > FADED)]
        force_noise = float(np.var(aside, ddof=1)) if aside.size >= LEAST_QUIET else 0.0
        window = near * laid
        self.force_noise = force_noise * float(np.sum(window**2))
        self.force = np.fft.rfft((hit.sign * force * window)[used], length)[chosen]
        self.response = np.fft.rfft((response * laid)[:, used], length, axis=1)[:, chosen]


def _tail(hit: Hit, before: int, after: int) -> float:
    """Time from the centroid of the pulse to the end of the samples that are used.

    Never left out: what looks quiet beside a loud stiff mode may be a soft one that still rings.
    """
    first, end = hit.pulse.around(len(hit.force_n))
    first = max(first, hit.pulse.peak - before)
    pulse = np.clip(hit.force_n[first:end] - hit.pulse.offset_n, 0.0, None)
    centroid = first + float(np.sum(np.arange(pulse.size) * pulse) / np.sum(pulse))
    # A sample stands for the time around it: the last one ends half a step after itself.
    return (hit.pulse.peak + after - 0.5 - centroid) / hit.sampling_rate_hz
