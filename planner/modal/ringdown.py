"""Modes from free decays, without a force: response-only records after a hit or a release.

The transform of a sampled exponential is rational in z, also when the record ends before it has
decayed: at the lines of the unpadded DFT the end only scales the residue. So the estimator of
FRFs serves unchanged, the decays taking the place of hit directions.
"""

import numpy as np

from planner.modal.fit_data import Data
from planner.modal.pole_identification import PoleIdentification, identify

# Poles of higher orders than this do not help with a handful of channels.
MAX_ORDER = 30
# Lines outside the band that are fitted too.
MARGIN = 0.15
LEAST_LINES = 6


def identify_decays(
    samples: np.ndarray,
    sampling_rate_hz: float,
    band_hz: tuple[float, float],
    max_order: int = MAX_ORDER,
) -> PoleIdentification | None:
    """Modes of simultaneous channels over several decays, None where there is none.

    samples (channels, decays, n). Means are taken off; slower drifts stay below the band.
    """
    n = samples.shape[-1]
    frequency = np.fft.rfftfreq(n, 1 / sampling_rate_hz)
    low, high = band_hz[0] / (1 + MARGIN), band_hz[1] * (1 + MARGIN)
    chosen = (frequency >= low) & (frequency <= high) & (frequency > 0)
    # The highest line of an even DFT is real and holds no phase.
    chosen &= frequency < 0.499 * sampling_rate_hz
    if np.count_nonzero(chosen) < LEAST_LINES:
        return None
    centred = samples - np.mean(samples, axis=-1, keepdims=True)
    spectrum = np.fft.rfft(centred, axis=-1)[..., chosen]
    if not np.any(spectrum):
        return None
    data = Data(frequency[chosen], spectrum, None, step_s=1 / sampling_rate_hz)
    return identify(data, max_order)
