"""Experimental modes of one pose."""

from dataclasses import dataclass

import numpy as np

# Less likely poles are not reported as modes.
LEAST_PROBABILITY = 0.2


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode: pole, residue and their standard deviations.

    Pole λ = −ζω₀ + iω₀√(1−ζ²), ω₀ = 2π·frequency_hz. Receptance
    H(ω) = Σ R/(iω−λ) + R*/(iω−λ*), accelerance −ω² times that, so `residue` (3, 3) is in
    m/(N·s); columns never hit are NaN. `shape` (3,) is the dominant left singular vector of the
    residue, scaled to unit length and rotated to be as real as possible.
    """

    frequency_hz: float
    frequency_sd_hz: float
    damping_ratio: float
    damping_sd: float
    residue: np.ndarray  # (3, 3) complex
    residue_sd: np.ndarray  # (3, 3) sd of real and imaginary part each
    shape: np.ndarray  # (3,) complex
    probability: float = 1.0  # that it is a physical mode

    @property
    def pole(self) -> complex:
        """Pole λ in rad/s."""
        w = 2 * np.pi * self.frequency_hz
        return complex(-self.damping_ratio * w, w * np.sqrt(max(0.0, 1 - self.damping_ratio**2)))


@dataclass(frozen=True, eq=False)
class ModalModel:
    """All modes found at one pose, increasing in frequency, and how well they fit.

    `doubtful` are poles less likely than `LEAST_PROBABILITY` to be a mode by this pose alone;
    other poses may speak for them (a mode near a nodal point is weak).
    """

    modes: tuple[Mode, ...]
    band_hz: tuple[float, float]
    fit_error: float  # ‖H − fit‖/‖H‖ over measured columns and band
    order: int  # model order from which the poles were taken
    remarks: tuple[str, ...] = ()
    doubtful: tuple[Mode, ...] = ()
