"""Measured FRFs of several poses as arrays with one noise level per value."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.dynamics.gradient import laplace
from planner.errors import InputError
from planner.frf.frf import Frf

# Where nothing is known of the noise: a share of the FRF, and one of the column's rms.
ASSUMED_RELATIVE, ASSUMED_FLOOR = 0.05, 0.01


@dataclass(frozen=True, eq=False)
class Measured:
    """FRFs of n poses at F lines each, lines being the pose's own.

    `s` (n, F) is the Laplace variable at which they hold, `accelerance` (n, 3, 3, F) in m/s²/N,
    `sd` (n, 3, 3, F) the root of E|δH|², ∞ where nothing was measured (accelerance is 1 there),
    `tail_s` (n,) as in `Frf`.
    """

    frequency_hz: np.ndarray
    s: np.ndarray
    accelerance: np.ndarray
    sd: np.ndarray
    tail_s: np.ndarray

    @property
    def used(self) -> np.ndarray:
        """(n, 3, 3, F) bool."""
        return np.isfinite(self.sd)


def common_band(frfs: Sequence[Frf], band_hz: tuple[float, float]) -> tuple[float, float]:
    """The part of a band in which any of the FRFs can be used. Raises InputError if there is none.

    Zero frequency is never part of it.
    """
    low = max(band_hz[0], min(f.usable_band_hz[0] for f in frfs))
    high = min(band_hz[1], max(f.usable_band_hz[1] for f in frfs))
    if not low < high:
        raise InputError(
            f"The FRFs can be used from {low:.4g} to {high:.4g} Hz within band_hz {list(band_hz)}, "
            f"which leaves nothing to fit; widen band_hz, or hit with a harder tip."
        )
    return low, high


def stack(
    frfs: Sequence[Frf], band_hz: tuple[float, float], most_lines: int, model_error: float
) -> Measured:
    """FRFs in a band, thinned out evenly to at most `most_lines` a pose.

    `model_error` is a relative sd added to that of the noise, for all that a simulation cannot
    follow: calibration, angles, friction.
    """
    chosen = [_lines(frf, band_hz, most_lines) for frf in frfs]
    n, f = len(frfs), max(len(c) for c in chosen)
    if f == 0:
        raise InputError(
            f"No frequency line lies between {band_hz[0]:.4g} and {band_hz[1]:.4g} Hz; record "
            f"longer, or widen band_hz."
        )
    frequency = np.full((n, f), float(band_hz[1]))
    h = np.ones((n, 3, 3, f), dtype=complex)
    sd = np.full((n, 3, 3, f), np.inf)
    for i, (frf, lines) in enumerate(zip(frfs, chosen, strict=True)):
        count = len(lines)
        frequency[i, :count] = frf.frequency_hz[lines]
        values, noise = frf.accelerance[..., lines], noise_sd(frf)[..., lines]
        given = np.isfinite(values) & np.isfinite(noise)
        total = np.sqrt(noise**2 + (model_error * np.abs(values)) ** 2)
        given &= total > 0
        h[i, ..., :count] = np.where(given, values, 1.0)
        sd[i, ..., :count] = np.where(given, total, np.inf)
    rates = np.array([frf.exponential_rate_1_s for frf in frfs])
    tails = np.array([frf.tail_s for frf in frfs])
    return Measured(frequency, laplace(frequency, rates), h, sd, tails)


def _lines(frf: Frf, band_hz: tuple[float, float], most: int) -> np.ndarray:
    low = max(band_hz[0], frf.usable_band_hz[0])
    high = min(band_hz[1], frf.usable_band_hz[1])
    inside = np.flatnonzero((frf.frequency_hz >= low) & (frf.frequency_hz <= high))
    inside = inside[frf.frequency_hz[inside] > 0]
    if len(inside) <= most:
        return inside
    return inside[np.linspace(0, len(inside) - 1, most).round().astype(int)]


def noise_sd(frf: Frf) -> np.ndarray:
    """Sd (3, 3, F) of an FRF: from the hits' scatter, else from the coherence, else assumed."""
    h, hits = np.abs(frf.accelerance), np.maximum(frf.hits, 1)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        # Bendat & Piersol 2010, eq. 9.90, for both parts of the complex value.
        share = np.sqrt((1 - frf.coherence) / (frf.coherence * hits))
        rms = np.sqrt(np.mean(h**2, axis=(0, 2), keepdims=True))
        assumed = np.hypot(ASSUMED_RELATIVE * h, ASSUMED_FLOOR * rms)
        from_coherence = np.where(np.isfinite(share), np.minimum(share, 10.0) * h, assumed)
    return np.where(np.isfinite(frf.variance), np.sqrt(frf.variance), from_coherence)
