"""The pulse in the force of a hit: where it begins, peaks and ends, and what is quiet before it.

Everything that looks at a pulse (screening, FRFs, force levels, the time left to decays) takes it
from here, so that all speak of the same samples.
"""

from typing import NamedTuple

import numpy as np

# The force belongs to the pulse where it exceeds this share of the peak and this many sds of noise.
PULSE_SHARE, PULSE_SDS = 0.1, 4.0
# Something has begun to happen where the force first exceeds these; a few samples earlier still.
RISING_SHARE, RISING_SDS, RISING_SAMPLES = 0.01, 5.0, 4
NORMAL_MAD = 1.4826  # sd of normal noise over its median absolute deviation
# Samples for which an anti-alias filter rings before and after a pulse, beside WIDTHS of the pulse.
RINGING_SAMPLES, RINGING_WIDTHS = 32, 3


class Pulse(NamedTuple):
    """Samples and sizes of a pulse.

    `quiet` samples at the record's start hold nothing but noise; the pulse itself is samples
    `first` up to but not including `end`, with its largest deviation at `peak`. `offset_n` (N) is
    the force at rest, `peak_n` (N) the size of that deviation, `noise_n` (N) the sd of the noise.
    """

    quiet: int
    first: int
    peak: int
    end: int
    offset_n: float
    peak_n: float
    noise_n: float

    def around(self, samples: int) -> tuple[int, int]:
        """Range (first, end) of a record of `samples` that holds the anti-alias ringing too."""
        margin = RINGING_SAMPLES + RINGING_WIDTHS * (self.end - self.first)
        return max(0, self.first - margin), min(samples, self.end + margin)


def find_pulse(force_n: np.ndarray) -> Pulse:
    """The main pulse of a force (n,) in N.

    It reaches as far around the peak as the force stays above PULSE_SHARE of the peak and PULSE_SDS
    of the noise. The noise is judged by the median, which a short pulse does not move.
    """
    offset = float(np.median(force_n))
    size = np.abs(force_n - offset)
    peak, noise = int(np.argmax(size)), NORMAL_MAD * float(np.median(size))
    top = float(size[peak])
    small = size <= max(PULSE_SHARE * top, PULSE_SDS * noise)
    before, after = np.flatnonzero(small[:peak]), np.flatnonzero(small[peak + 1 :])
    first = int(before[-1]) + 1 if before.size else 0
    end = peak + 1 + int(after[0]) if after.size else len(size)
    rising = np.flatnonzero(size > max(RISING_SHARE * top, RISING_SDS * noise))
    quiet = max(0, int(rising[0]) - RISING_SAMPLES) if rising.size else 0
    return Pulse(quiet, first, peak, end, offset, top, noise)
