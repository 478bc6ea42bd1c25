"""Spectra of one hit as its screens look at it: what it rests at taken out, lines in the band."""

import numpy as np

from planner.recording.records import Hit


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
