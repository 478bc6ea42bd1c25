"""Dwells of a real beam on a moving roller (DROPBEAR), and their first modes."""

import numpy as np

# Pin location (V) and first mode (Hz), as the shared data's README states them.
FIRST_MODE = {1.645: 28.23, 2.081: 30.82, 2.502: 33.89, 2.933: 37.56, 3.365: 41.97}


def dwells(pin: np.ndarray, rate_hz: float) -> list[slice]:
    """Stretches of half a second or more in which the pin stands still."""
    smooth = np.convolve(pin, np.ones(100) / 100, "same")
    span = int(0.05 * rate_hz)
    still = np.zeros(pin.size, bool)
    still[span // 2 : pin.size - span + span // 2] = np.abs(smooth[span:] - smooth[:-span]) < 0.02
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]])))
    pairs = zip(edges[::2], edges[1::2], strict=True)
    return [slice(a, b) for a, b in pairs if b - a > 0.5 * rate_hz]
