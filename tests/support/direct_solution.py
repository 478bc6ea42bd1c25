"""FRFs by solving the equation of motion at every line: the slow reference."""

import numpy as np


def direct_accelerance(
    mass: np.ndarray,
    damping: np.ndarray,
    stiffness: np.ndarray,
    hit: np.ndarray,
    sensor: np.ndarray,
    frequency_hz: np.ndarray,
) -> np.ndarray:
    """Accelerance (3s, 3h, F) in m/s²/N of one pose at frequency_hz (F,).

    mass, damping, stiffness (d, d); hit (3h, d) and sensor (3s, d) Jacobians.
    """
    s = 2j * np.pi * np.asarray(frequency_hz)[:, None, None]
    dynamic = s**2 * mass + s * damping + stiffness
    moved = np.linalg.solve(dynamic, np.broadcast_to(hit.T, (len(s), *hit.T.shape)))
    return np.moveaxis(s**2 * (sensor @ moved), 0, -1)
