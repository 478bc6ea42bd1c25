"""Where a mode could hide in the noise or between the lines of FRFs, and chatter at less."""

import numpy as np

from planner.milling.cutter_fit import CutterFit

DAMPING = 0.01  # of a mode that may be hidden: less damped ones are rare; chosen
SLOWEST_HZ = 2.0  # machines and robots have no mode below; chosen


def hidden_below(fit: CutterFit, mean: np.ndarray, depth_m: float) -> float | None:
    """The highest frequency in Hz at which a mode that chatters below a depth could hide, if any.

    A mode whose receptance peaks at P chatters from about 1/(K·P) on, K the norm of the cut's mean
    matrix (2, 2) in N/m². It stands out from the noise of the accelerance where its χ², summed over
    the lines that meet its resonance, passes chance; between two of them at the worst.
    """
    hertz = fit.frf.frequency_hz
    half = np.pi * DAMPING * hertz / np.median(np.diff(hertz))  # π times lines in half a width
    met = half * np.tanh(half)  # Σ |H/P|² over the lines
    seen = fit.noise * np.sqrt(fit.found.data.threshold / (2 * met))
    hidden = hertz[(seen * np.linalg.norm(mean, 2) * depth_m > 1) & (hertz > SLOWEST_HZ)]
    return float(hidden[-1]) if hidden.size else None
