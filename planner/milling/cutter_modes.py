"""Modes at the cutter: as poles and shapes, and as a TOML file with [[mode]] tables states them."""

from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from planner.errors import InputError
from planner.milling.cut import check_limits, check_unit
from planner.toml_file import load_toml


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


class StatedMode(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A mode: undamped natural frequency, damping, modal mass, and how well each is known.

    `direction` is the unit vector along which it moves and is driven.
    """

    frequency_hz: float
    damping_ratio: float
    mass_kg: float
    direction: tuple[float, float, float]
    frequency_sd_hz: float = 0.0
    damping_sd: float = 0.0
    mass_sd_percent: float = 0.0


class ModeFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole file."""

    mode: list[StatedMode]

    @property
    def modes(self) -> CutterModes:
        """As poles and shapes, in the frame of the file."""
        return real_modes(
            np.array([m.frequency_hz for m in self.mode]),
            np.array([m.damping_ratio for m in self.mode]),
            np.array([m.mass_kg for m in self.mode]),
            np.array([m.direction for m in self.mode]),
        )

    @property
    def relative_sds(self) -> np.ndarray:
        """(n, 3) of frequency, damping and residue, whose size falls as the mass rises."""
        return np.array([
            [m.frequency_sd_hz / m.frequency_hz, m.damping_sd / m.damping_ratio,
             m.mass_sd_percent / 100] for m in self.mode
        ])  # fmt: skip


def load_mode_file(path: Path) -> ModeFile:
    """Read and check a file of modes; InputError with one sentence where it is wrong."""
    found = load_toml(path, ModeFile, "file of [[mode]] tables")
    if not found.mode:
        raise InputError(f"{path} holds no [[mode]]; state at least one.")
    for i, mode in enumerate(found.mode, 1):
        _check(mode, f"{path}: [[mode]] {i}")
    return found


def _check(mode: StatedMode, where: str) -> None:
    limits = [
        ("frequency_hz", mode.frequency_hz, 1e-3, 1e6),
        ("damping_ratio", mode.damping_ratio, 1e-7, 0.999),
        ("mass_kg", mode.mass_kg, 1e-9, 1e9),
        ("frequency_sd_hz", mode.frequency_sd_hz, 0.0, mode.frequency_hz),
        ("damping_sd", mode.damping_sd, 0.0, 1.0),
        ("mass_sd_percent", mode.mass_sd_percent, 0.0, 100.0),
    ]
    check_limits(where, limits)
    check_unit(where, direction=mode.direction)
