"""FRFs that the other engine (MuJoCo) would measure."""

import numpy as np

from planner.frf.frf import Frf
from planner.proof.model import Truth


def measured_frfs(
    truth: Truth, q: np.ndarray, frequency_hz: np.ndarray, noise: float, seed: int = 0
) -> tuple[Frf, ...]:
    """FRFs at q (n, dof) with white noise.

    The noise of an accelerometer is the same at all lines and in all directions: `noise` is its
    share of the rms of the strongest of the three responses to a hit.
    """
    rng, out = np.random.default_rng(seed), []
    for row in q:
        h = truth.accelerance(row, frequency_hz)
        rms = np.sqrt(np.mean(np.abs(h) ** 2, axis=2)).max(axis=0)
        sd = np.broadcast_to(noise * rms[None, :, None], h.shape)
        error = sd * (rng.standard_normal(h.shape) + 1j * rng.standard_normal(h.shape))
        band = float(frequency_hz[0]), float(frequency_hz[-1])
        nan = np.full(h.shape, np.nan)
        out.append(Frf(frequency_hz, h + error / np.sqrt(2), sd**2, nan, (1, 1, 1), band))
    return tuple(out)
