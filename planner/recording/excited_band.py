"""The band that hits excite: in which modes are looked for where nobody states one."""

from collections.abc import Sequence

import numpy as np

from planner.recording.records import Hit

# From this line on (the first ones hold offsets and drift), to where the usual pulse has lost so
# much; a hit that has lost twice as much (in dB) there is refused as too soft. Beyond a share of
# the sampling rate anti-alias filters act.
FIRST_LINE, LOST_DB, OF_RATE = 3, 10.0, 0.44


def excited_band(hits: Sequence[Hit]) -> tuple[float, float]:
    """Lowest and highest frequency in Hz to three digits, by the median of hits (n ≥ 1)."""
    low, high = np.median([_band(hit) for hit in hits], axis=0)
    return float(f"{low:.3g}"), float(f"{high:.3g}")


def _band(hit: Hit) -> tuple[float, float]:
    pulse, rate, samples = hit.pulse, hit.sampling_rate_hz, len(hit.force_n)
    first, end = pulse.around(samples)
    spectrum = np.abs(np.fft.rfft(hit.force_n[first:end] - pulse.offset_n, samples))
    lost = spectrum < np.max(spectrum) * 10 ** (-LOST_DB / 20)
    lost[: int(np.argmax(spectrum))] = False
    line = int(np.argmax(lost)) if lost.any() else samples // 2
    return FIRST_LINE * rate / samples, min(line / samples, OF_RATE) * rate
