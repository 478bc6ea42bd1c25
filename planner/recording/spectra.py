"""Spectra of one hit: lines in a band, the band that hits excite, and where a hit is felt.

Where a hit is felt a passive structure takes power in: Im H ≥ 0 at a driving point.
"""

from collections.abc import Sequence

import numpy as np

from planner.recording.points import SENSOR, TCP
from planner.recording.records import AXES, Fault, Hit

# From this line on (the first ones hold offsets and drift), to where the usual pulse has lost so
# much; a hit that has lost twice as much (in dB) there is refused as too soft. Beyond a share of
# the sampling rate anti-alias filters act.
FIRST_LINE, LOST_DB, OF_RATE = 3, 10.0, 0.44
# Share of |Im H| over the band with the right sign. Right hits have 0.9 and more where the sensor
# sits near the point, hits of turned sign what is missing to 1. Chosen between.
TURNED = 0.2
FLOOR = 1e-3  # of the force's largest line, below which a line says nothing


def band_spectra(
    hit: Hit,
    band_hz: tuple[float, float],
    rest_n: float,
    samples: int | None = None,
    rate_hz: float | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Force (F,) along the axis and accelerations (r, F) over the band's lines.

    `rest_n` is what the force channel shows without a force; only the first `samples` are taken.
    `rate_hz` is that of hits it is compared with, which a rounded time column tells slightly off.
    """
    count = len(hit.force_n) if samples is None else samples
    frequency = np.fft.rfftfreq(count, 1 / (rate_hz or hit.sampling_rate_hz))
    inside = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    force = np.fft.rfft((hit.sign * (hit.force_n - rest_n))[:count])[inside]
    rest = np.median(hit.acceleration_m_s2, axis=1, keepdims=True)
    response = np.fft.rfft((hit.acceleration_m_s2 - rest)[:, :count], axis=1)[:, inside]
    return force, response


def excited_band(hits: Sequence[Hit]) -> tuple[float, float]:
    """Lowest and highest frequency in Hz to three digits, by the median of hits (n ≥ 1)."""
    bands = []
    for hit in hits:
        pulse, rate, samples = hit.pulse, hit.sampling_rate_hz, len(hit.force_n)
        first, end = pulse.around(samples)
        spectrum = np.abs(np.fft.rfft(hit.force_n[first:end] - pulse.offset_n, samples))
        lost = spectrum < np.max(spectrum) * 10 ** (-LOST_DB / 20)
        lost[: int(np.argmax(spectrum))] = False
        line = int(np.argmax(lost)) if lost.any() else samples // 2
        bands.append((FIRST_LINE * rate / samples, min(line / samples, OF_RATE) * rate))
    low, high = np.median(bands, axis=0)
    return float(f"{low:.3g}"), float(f"{high:.3g}")


def driving_point(hit: Hit, band_hz: tuple[float, float]) -> tuple[Fault, ...]:
    """A remark where the tool answers against the hit: sign of the hit, or polarity of a channel.

    The sensor has to be near the point that is hit; only hits at the tcp are judged.
    """
    own = hit.channels_of(SENSOR)
    if own is None or hit.hit_point != TCP or _positive_share(own, band_hz) > TURNED:
        return ()
    axis = AXES[hit.axis_index]
    text = (
        f"The tool answers hits along {hit.axis} against their direction (Im H < 0 along {axis}, "
        f"where it is hit); check the sign of the axis and the polarity of force and acceleration."
    )
    return (Fault("driving_point", text, refuse=False),)


def _positive_share(hit: Hit, band_hz: tuple[float, float]) -> float:
    """Share of |Im H|, in [0, 1], with the right sign; H of the hit's own axis, x, y, z heard."""
    force, answers = band_spectra(hit, band_hz, hit.pulse.offset_n)
    answer = answers[hit.axis_index]
    power = np.abs(force) ** 2
    strong = power > FLOOR**2 * np.max(power, initial=0.0)
    imag = np.imag(answer[strong] * force[strong].conj()) / power[strong]
    total = np.sum(np.abs(imag))
    return float(np.sum(imag[imag > 0]) / total) if total > 0 else 1.0
