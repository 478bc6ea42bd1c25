"""Modal synthesis: poles and residues to FRFs, the one formula that every stage shares."""

import math

import numpy as np


def pole(frequency_hz: np.ndarray | float, damping_ratio: np.ndarray | float) -> np.ndarray:
    """Complex poles (rad/s) of natural frequencies (Hz) and damping ratios; shapes broadcast."""
    omega = 2 * np.pi * np.asarray(frequency_hz)
    zeta = np.asarray(damping_ratio)
    return -zeta * omega + 1j * omega * np.sqrt(np.maximum(0.0, 1 - zeta**2))


def accelerance(frequency_hz: np.ndarray, poles: np.ndarray, residues: np.ndarray) -> np.ndarray:
    """Accelerance (..., *out, F) in m/s²/N of modes (Busch et al. 2022, eq. 9), as `receptance`."""
    return (2j * np.pi * np.asarray(frequency_hz)) ** 2 * receptance(frequency_hz, poles, residues)


def receptance(frequency_hz: np.ndarray, poles: np.ndarray, residues: np.ndarray) -> np.ndarray:
    """Receptance (..., *out, F) = Σ_m [R/(iω−λ) + R*/(iω−λ*)] in m/N of modes.

    frequency_hz (F,); poles (..., m) in rad/s; residues (..., m, *out) in m/(N·s).
    """
    iw = 2j * np.pi * np.asarray(frequency_hz)
    poles = np.asarray(poles)
    residues = np.asarray(residues)
    out = residues.shape[poles.ndim :]
    flat = residues.reshape(*poles.shape, math.prod(out))  # of no mode, too
    basis = 1 / (iw - poles[..., None])
    basis_conj = 1 / (iw - poles.conj()[..., None])
    found = np.einsum("...mk,...mf->...kf", flat, basis)
    found = found + np.einsum("...mk,...mf->...kf", flat.conj(), basis_conj)
    return found.reshape(*poles.shape[:-1], *out, iw.size)


def frequency_lines(band_hz: tuple[float, float]) -> np.ndarray:
    """Lines (F,) in Hz over a band: 0.1 Hz apart, at most 2000 intervals of them."""
    low, high = band_hz
    # Spacing (hz): a fifth of the half-power bandwidth of a mode at 10 Hz with 2.5 % damping
    return np.linspace(low, high, min(2000, round((high - low) / 0.1)) + 1)
