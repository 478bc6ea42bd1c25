"""One pole under a force that is linear between samples, exactly."""

import numpy as np
from scipy import signal


def weights(pole: np.ndarray, step_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """y(t + h) = grow y(t) + older f(t) + newer f(t + h), exact if f is linear between."""
    z = pole * step_s
    grow = np.exp(z)
    newer = (grow - 1 - z) / (z * pole)
    return grow, (grow - 1) / pole - newer, newer


def driven(pole: complex, force: np.ndarray, step_s: float) -> np.ndarray:
    """y (..., n) of y' = λy + f from rest, for f (..., n) linear between samples."""
    grow, older, newer = weights(np.asarray(pole), step_s)
    return np.asarray(signal.lfilter([newer, older], [1.0, -grow], force.astype(complex)))
