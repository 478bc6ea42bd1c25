"""Modes at the cutter: as a TOML file with [[mode]] tables states them, or from its FRFs.

These are fitted as `planner modes` does, in accelerance, as sensors measure it: its noise is alike
at all lines, and lines that hold nothing else count for nothing. Divided by ω² the lowest of them
would govern the fit.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np

from planner.errors import InputError
from planner.frf.synthesis import pole, receptance
from planner.milling.cut import Percent, check_unit
from planner.milling.cutter_frf import CutterFrf
from planner.modal.estimate_modes import identify, inflation
from planner.modal.fit_data import Data
from planner.modal.rank_one_fit import Entries
from planner.modal.residues import unpack
from planner.modal.shape_fit import shape_fit
from planner.toml_file import limited, load_toml


@dataclass(frozen=True, eq=False)
class CutterModes:
    """Receptance H(s) = Σ_k [ψ_k l_kᵀ/(s − λ_k) + its conjugate] + residual, in m/N.

    Poles (k,) in rad/s with a positive imaginary part; shapes ψ and drives l (k, d); `residual`
    (d, d) is the compliance of all higher modes. d is 3 in the frame of the FRFs, or 2 in the plane
    of a cut.
    """

    poles: np.ndarray
    shapes: np.ndarray
    drives: np.ndarray
    residual: np.ndarray

    def receptance(self, frequency_hz: np.ndarray) -> np.ndarray:
        """(F, d, d) in m/N at frequencies (F,)."""
        residues = self.shapes[:, :, None] * self.drives[:, None]
        return np.moveaxis(receptance(frequency_hz, self.poles, residues), -1, 0) + self.residual

    def in_plane(self, plane: np.ndarray) -> "CutterModes":
        """In the plane of a cut, (2, d) unit vectors; modes that do not show there are left out."""
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
    poles, shapes = pole(frequency_hz, damping_ratio), np.asarray(direction, dtype=complex)
    drives = shapes / (2j * np.asarray(mass_kg) * poles.imag)[:, None]
    size = shapes.shape[1]
    return CutterModes(poles, shapes, drives, np.zeros((size, size)))


class StatedMode(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A mode: undamped natural frequency, damping, modal mass, and how well each is known.

    `direction` is the unit vector along which it moves and is driven.
    """

    frequency_hz: Annotated[float, limited(ge=1e-3, le=1e6)]
    damping_ratio: Annotated[float, limited(ge=1e-7, le=0.999)]
    mass_kg: Annotated[float, limited(ge=1e-9, le=1e9)]
    direction: tuple[float, float, float]
    frequency_sd_hz: Annotated[float, limited(ge=0)] = 0.0
    damping_sd: Annotated[float, limited(ge=0, le=1)] = 0.0
    mass_sd_percent: Percent = 0.0


class ModeFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole file."""

    mode: list[StatedMode]

    @property
    def modes(self) -> CutterModes:
        """As poles and shapes, in the frame of the file."""
        hertz, damping, mass = np.array(
            [(m.frequency_hz, m.damping_ratio, m.mass_kg) for m in self.mode]
        ).T
        return real_modes(hertz, damping, mass, np.array([m.direction for m in self.mode]))

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
    if mode.frequency_sd_hz > mode.frequency_hz:
        raise InputError(
            f"{where}: frequency_sd_hz is more than frequency_hz; correct one of them."
        )
    check_unit(where, direction=mode.direction)


class CutterFit:
    """FRFs in the plane of a cut and the modes found in them.

    FRFs that are 0 throughout are no data: `there` (2, 2) has the others, which are fitted as rows
    of one column where some are not.
    """

    def __init__(self, frf: CutterFrf) -> None:
        """InputError where the FRFs hold no mode."""
        accelerance = frf.receptance * (2j * np.pi * frf.frequency_hz) ** 2
        there = np.any(accelerance != 0, axis=-1)
        variance = frf.allowance
        if not np.all(there):
            accelerance = accelerance[there][:, None]
            variance = None if variance is None else variance[there][:, None]
        # Of two poles where one mode drifted both may stay: it is their FRF that chatters.
        data = Data(frf.frequency_hz, accelerance, variance, steady=True)
        found = identify(data) if np.any(there) else None
        if found is None or not (found.modes or frf.sd is not None):
            ends = frf.frequency_hz[[0, -1]]
            raise InputError(
                f"{frf.name}: no mode shows between {ends[0]:g} and {ends[1]:g} Hz; measure over "
                f"the band of the modes that chatter, at finer lines or with more averages."
            )
        alone = np.zeros((2 * found.fit.poles.size,) * 2)
        scale = found.scale * inflation(data, found.fit, alone)
        rows, columns = np.nonzero(there)
        self.frf, self.there, self.found = frf, there, found
        self.shaped = shape_fit(data, found.fit, Entries(rows, columns, 2), scale)

    @cached_property
    def modes(self) -> CutterModes:
        """Those that are established, and what modes above the lines give way."""
        return self._as_modes(self.shaped.poles, self.shaped.coefficients)

    def drawn(self, count: int, seed: int) -> list[CutterModes]:
        """So many sets of modes that are as likely as each other, by the noise of the FRFs."""
        return [self._as_modes(*one) for one in self.shaped.drawn(count, seed)]

    def _whole(self, values: np.ndarray) -> np.ndarray:
        """(2, 2, n) of values (e, n) of the fitted FRFs."""
        out = np.zeros((2, 2, values.shape[-1]), values.dtype)
        out[self.there] = values
        return out

    def _as_modes(self, fitted: np.ndarray, coefficients: np.ndarray) -> CutterModes:
        """With two shapes and drives where a pole may stand for several modes.

        Predicted FRFs hold no noise: all their poles count, however damped.
        """
        residue, rest = (self._whole(part) for part in unpack(coefficients, fitted.size))
        kept = np.flatnonzero((self.found.weak <= 1) | (self.frf.sd is not None))
        which = np.repeat(kept, np.where(np.isin(kept, self.shaped.shaped), 1, 2))
        part = np.append(0, (np.diff(which) == 0).astype(int))
        left, sizes, right = np.linalg.svd(np.moveaxis(residue, -1, 0)[which])
        number = np.arange(which.size)
        shapes = left[number, :, part] * sizes[number, part][:, None]
        return CutterModes(fitted[which], shapes, right[number, part], rest[..., -1].real)

    def receptance(self, told: np.ndarray) -> np.ndarray:
        """(F, 2, 2) in m/N of the modes; of others below too at lines (F,) that tell of these."""
        s = 2j * np.pi * self.frf.frequency_hz[told, None, None]
        found = self.modes.receptance(self.frf.frequency_hz)
        _, rest = unpack(self.shaped.coefficients, self.shaped.poles.size)
        found[told] += self._whole(rest)[..., 0] / s**2
        return found

    @property
    def noise(self) -> np.ndarray:
        """(F,) in m/N: root of E‖δH‖² at each line."""
        square = np.sum(self.found.fit.variance, axis=0)
        return np.sqrt(square) / (2 * np.pi * self.frf.frequency_hz) ** 2


def hidden_below(fit: CutterFit, mean: np.ndarray, depth_m: float) -> float | None:
    """The highest frequency in Hz at which a mode that chatters below a depth could hide, if any.

    A mode whose receptance peaks at P chatters from about 1/(K·P) on, K the norm of the cut's mean
    matrix (2, 2) in N/m². It stands out from the noise of the accelerance where its χ², summed over
    the lines that meet its resonance, passes chance; between two of them at the worst.
    """
    hertz = fit.frf.frequency_hz
    # Damping of a mode that may be hidden: less damped ones are rare; chosen
    half = np.pi * 0.01 * hertz / np.median(np.diff(hertz))  # π times lines in half a width
    met = half * np.tanh(half)  # Σ |H/P|² over the lines
    seen = fit.noise * np.sqrt(fit.found.data.threshold / (2 * met))
    # Machines and robots have no mode below 2 Hz; chosen
    hidden = hertz[(seen * np.linalg.norm(mean, 2) * depth_m > 1) & (hertz > 2.0)]
    return float(hidden[-1]) if hidden.size else None
