"""Modal synthesis: poles and residues to FRFs, the one formula that every stage shares.

One FRF as receptance, mobility or accelerance: each is iω times the one before it. The motion per
force is a displacement, a velocity or an acceleration (Ewins, Modal Testing, 2000, ch. 1).
"""

import math

import numpy as np

from planner.errors import InputError


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


# How often the displacement is differentiated, by the name of the FRF.
DERIVATIVE = {"receptance": 0, "mobility": 1, "accelerance": 2}


def convert(frequency_hz: np.ndarray, frf: np.ndarray, given: str, wanted: str) -> np.ndarray:
    """FRF (..., F) of the kind `given`, in SI units, as one of the kind `wanted`, in SI units.

    frequency_hz (F,). Kinds are "receptance" (m/N), "mobility" (m/s/N), "accelerance" (m/s²/N).
    Raises InputError for another kind, and where a line at 0 Hz would have to be integrated.
    """
    for kind in (given, wanted):
        if kind not in DERIVATIVE:
            raise InputError(
                f"An FRF of kind {kind!r} is not known; say one of {', '.join(DERIVATIVE)}."
            )
    times = DERIVATIVE[wanted] - DERIVATIVE[given]
    if times < 0 and np.any(np.asarray(frequency_hz) == 0):
        raise InputError(f"A line at 0 Hz of {given} has no {wanted}: leave that line out.")
    return np.asarray(frf) * (2j * np.pi * np.asarray(frequency_hz)) ** times
