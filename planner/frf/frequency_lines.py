"""Frequency lines at which FRFs are predicted."""

import numpy as np

SPACING_HZ = 0.1  # a fifth of the half-power bandwidth of a mode at 10 Hz with 2.5 % damping
MOST = 2000


def frequency_lines(band_hz: tuple[float, float]) -> np.ndarray:
    """Lines (F,) in Hz over a band: 0.1 Hz apart, at most 2000 intervals of them."""
    low, high = band_hz
    return np.linspace(low, high, min(MOST, round((high - low) / SPACING_HZ)) + 1)
