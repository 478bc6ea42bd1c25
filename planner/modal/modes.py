"""Experimental modes of one pose."""

from dataclasses import dataclass, replace

import numpy as np

# Less likely poles are not reported as modes.
LEAST_PROBABILITY = 0.2


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode: pole, residues, shape, and their standard deviations.

    Pole λ = −ζω₀ + iω₀√(1−ζ²), ω₀ = 2π·frequency_hz. Receptance
    H(ω) = Σ R/(iω−λ) + R*/(iω−λ*), accelerance −ω² times that, so `residue` (outputs, inputs) is
    in m/(N·s); columns never hit are NaN, as are all where nothing scales them. `shape` (n,) is of
    unit modal mass (kg^-1/2) where `scaled`, else of unit length and as real as possible;
    `shape_sd` (n,), like `residue_sd`, is of real and imaginary part each. `collinearity` is the
    MPC, `deviation_deg` the MPD. `misfit` is χ² per degree of freedom that one shape leaves in the
    residues, `scatter_hz` the sd of the frequency from set to set of roving points beyond their
    noise, `support` the share of the higher model orders that have this pole. What an analysis does
    not tell is NaN or None.
    """

    frequency_hz: float
    frequency_sd_hz: float
    damping_ratio: float
    damping_sd: float
    residue: np.ndarray  # complex
    residue_sd: np.ndarray
    shape: np.ndarray  # complex
    probability: float = 1.0  # that it is a physical mode
    shape_sd: np.ndarray | None = None
    scaled: bool = False
    collinearity: float = float("nan")
    deviation_deg: float = float("nan")
    misfit: float = float("nan")
    scatter_hz: float = 0.0
    support: float = float("nan")

    @property
    def pole(self) -> complex:
        """Pole λ in rad/s."""
        w = 2 * np.pi * self.frequency_hz
        return complex(-self.damping_ratio * w, w * np.sqrt(max(0.0, 1 - self.damping_ratio**2)))

    @property
    def modal_mass_kg(self) -> float:
        """Of the shape with largest component 1; NaN where it has no scale."""
        return 1 / float(np.max(np.abs(self.shape)) ** 2) if self.scaled else float("nan")

    def unscaled(self) -> "Mode":
        """The same without residues, which nothing scales."""
        nothing = np.full((3, 3), np.nan)
        return replace(self, residue=nothing.astype(complex), residue_sd=nothing)


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
