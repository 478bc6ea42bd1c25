"""How residues of known poles change where the FRFs they were fitted to change."""

import numpy as np

from planner.frf.frf import Frf
from planner.modal.residues import basis, laplace, stack


def residue_changes(
    frf: Frf,
    poles: np.ndarray,
    outside: np.ndarray,
    band_hz: tuple[float, float],
    changes: np.ndarray,
) -> np.ndarray:
    """Residues (c, m, 3, 3) in m/(N·s) that changes of an FRF add to those of its poles.

    Least squares with the weights of the FRF's own fit, out-of-band terms free.

    Args:
        frf: The FRF that the residues are of.
        poles: (m,) in rad/s.
        outside: Poles (k,) beside the band by which it may change too.
        band_hz: In which it is compared.
        changes: (c, 3, 3, F) in m/s²/N at its lines; columns that were never hit do not count.
    """
    f = frf.frequency_hz
    chosen = (f >= band_hz[0]) & (f <= min(band_hz[1], frf.usable_band_hz[1]))
    lines = laplace(f[chosen], frf.exponential_rate_1_s, frf.tail_s)
    every, m = np.concatenate([poles, outside]), len(poles)
    columns = basis(lines, every)
    out = np.zeros((len(changes), m, 3, 3), dtype=complex)
    for i in range(3):
        for j in np.flatnonzero(frf.measured):
            variance = frf.variance[i, j, chosen]
            known = bool(np.all(np.isfinite(variance) & (variance > 0)))
            root = 1 / np.sqrt(variance) if known else np.ones(len(variance))
            a, b = stack(columns * root).T, stack(changes[:, i, j, chosen] * root).T
            norm = np.linalg.norm(a, axis=0)
            found = np.linalg.lstsq(a / norm, b, rcond=None)[0] / norm[:, None]
            out[:, :, i, j] = (found[:m] + 1j * found[len(every) : len(every) + m]).T
    return out
