"""FRFs by solving the equation of motion at every line: the slow reference."""

import numpy as np
import scipy.linalg


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
    lines = []
    for w in 2 * np.pi * np.asarray(frequency_hz):
        dynamic = stiffness - w**2 * mass + 1j * w * damping
        lines.append(-(w**2) * sensor @ scipy.linalg.solve(dynamic, hit.T.astype(complex)))
    return np.stack(lines, axis=-1)
