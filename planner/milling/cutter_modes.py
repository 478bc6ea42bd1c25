"""The structure at the cutter as poles and shapes: what the time-domain methods need."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class CutterModes:
    """Receptance H(s) = Σ_k [ψ_k l_kᵀ/(s − λ_k) + its conjugate] + residual, in m/N.

    Poles (k,) in rad/s with a positive imaginary part, or real (then without a conjugate); shapes ψ
    and drives l (k, d); `residual` (d, d) is the compliance of all higher modes. d is 3 in the
    frame of the FRFs, or 2 in the plane of a cut.
    """

    poles: np.ndarray
    shapes: np.ndarray
    drives: np.ndarray
    residual: np.ndarray

    @property
    def weight(self) -> np.ndarray:
        """(k,) 2 for poles that stand for a pair, 1 for real ones: of the real part."""
        return np.where(self.poles.imag > 0, 2.0, 1.0)

    def receptance(self, frequency_hz: np.ndarray) -> np.ndarray:
        """(F, d, d) in m/N at frequencies (F,)."""
        s = 2j * np.pi * np.asarray(frequency_hz, dtype=float)[:, None]
        pair = self.poles.imag > 0
        direct = 1 / (s - self.poles)
        conjugate = np.where(pair, 1 / (s - self.poles.conj()), 0.0)
        found = np.einsum("fk,ki,kj->fij", direct, self.shapes, self.drives)
        found += np.einsum("fk,ki,kj->fij", conjugate, self.shapes.conj(), self.drives.conj())
        return found + self.residual

    def in_plane(self, plane: np.ndarray) -> "CutterModes":
        """In the plane of a cut, (2, 3) unit vectors; modes that do not show there are left out."""
        shapes, drives = self.shapes @ plane.T, self.drives @ plane.T
        size = np.linalg.norm(shapes, axis=1) * np.linalg.norm(drives, axis=1)
        whole = np.linalg.norm(self.shapes, axis=1) * np.linalg.norm(self.drives, axis=1)
        seen = size > SEEN * np.maximum(whole, 1e-300)
        residual = plane @ self.residual @ plane.T
        return CutterModes(self.poles[seen], shapes[seen], drives[seen], residual)


SEEN = 1e-12  # of a mode's size: what shows less in the plane of a cut does not show


def real_modes(
    frequency_hz: np.ndarray,
    damping_ratio: np.ndarray,
    mass_kg: np.ndarray,
    direction: np.ndarray,
) -> CutterModes:
    """Of modes with real shapes: natural frequencies (n,), damping below 1, modal masses.

    direction (n, d): unit vectors along which each moves and is driven.
    """
    omega = 2 * np.pi * np.asarray(frequency_hz, dtype=float)
    zeta = np.asarray(damping_ratio, dtype=float)
    damped = omega * np.sqrt(1 - zeta**2)
    shapes = np.asarray(direction, dtype=complex)
    drives = shapes / (2j * np.asarray(mass_kg) * damped)[:, None]
    size = shapes.shape[1]
    return CutterModes(-zeta * omega + 1j * damped, shapes, drives, np.zeros((size, size)))
