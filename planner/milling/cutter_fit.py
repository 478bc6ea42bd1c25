"""Modes at the cutter from its FRFs, as `planner modes` finds them, and how sure they are.

They are fitted in accelerance, as sensors measure it: its noise is alike at all lines, and lines
that hold nothing else count for nothing. Divided by ω² the lowest of them would govern the fit.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.errors import InputError
from planner.milling.cutter_frf import CutterFrf
from planner.milling.cutter_modes import CutterModes
from planner.modal.estimate_modes import PoleIdentification, identify, inflation
from planner.modal.fit_data import Data
from planner.modal.mode_selection import scales, weakness
from planner.modal.rank_one_fit import Entries
from planner.modal.residues import Residues
from planner.modal.shape_fit import ShapeFit, shape_fit


@dataclass(frozen=True, eq=False)
class CutterFit:
    """FRFs in the plane of a cut and the modes found in them.

    FRFs that are 0 throughout are no data: `there` (2, 2) has the others, which are fitted as rows
    of one column where some are not.
    """

    frf: CutterFrf
    there: np.ndarray
    found: PoleIdentification
    shaped: ShapeFit

    @classmethod
    def of(cls, frf: CutterFrf) -> "CutterFit":
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
        scale = scales(data, found.fit) * inflation(data, found.fit, alone)
        rows, columns = np.nonzero(there)
        return cls(frf, there, found, shape_fit(data, found.fit, Entries(rows, columns, 2), scale))

    @cached_property
    def modes(self) -> CutterModes:
        """Those that are established, and what modes above the lines give way."""
        return self._as_modes(self.shaped.poles, self.shaped.residues)

    def drawn(self, count: int, seed: int) -> list[CutterModes]:
        """So many sets of modes that are as likely as each other, by the noise of the FRFs."""
        return [self._as_modes(*one) for one in self.shaped.drawn(count, seed)]

    def _whole(self, values: np.ndarray) -> np.ndarray:
        """(2, 2, n) of values (e, n) of the fitted FRFs."""
        out = np.zeros((2, 2, values.shape[-1]), values.dtype)
        out[self.there] = values
        return out

    def _as_modes(self, fitted: np.ndarray, residues: Residues) -> CutterModes:
        """With two shapes and drives where a pole may stand for several modes.

        Predicted FRFs hold no noise: all their poles count, however damped.
        """
        residue, upper = self._whole(residues.residue), self._whole(residues.rest)[..., -1]
        weak = weakness(self.found.data, self.found.fit)
        kept = np.flatnonzero((weak <= 1) | (self.frf.sd is not None))
        which = np.repeat(kept, np.where(np.isin(kept, self.shaped.shaped), 1, 2))
        part = np.append(0, (np.diff(which) == 0).astype(int))
        left, sizes, right = np.linalg.svd(np.moveaxis(residue, -1, 0)[which])
        number = np.arange(which.size)
        shapes = left[number, :, part] * sizes[number, part][:, None]
        return CutterModes(fitted[which], shapes, right[number, part], upper.real)

    def receptance(self, told: np.ndarray) -> np.ndarray:
        """(F, 2, 2) in m/N of the modes; of others below too at lines (F,) that tell of these."""
        s = 2j * np.pi * self.frf.frequency_hz[told, None, None]
        found = self.modes.receptance(self.frf.frequency_hz)
        found[told] += self._whole(self.shaped.residues.rest)[..., 0] / s**2
        return found

    @property
    def noise(self) -> np.ndarray:
        """(F,) in m/N: root of E‖δH‖² at each line."""
        square = np.sum(self.found.fit.variance, axis=(0, 1))
        return np.sqrt(square) / (2 * np.pi * self.frf.frequency_hz) ** 2

    @property
    def error(self) -> float:
        """‖accelerance − fit‖/‖accelerance‖."""
        return self.found.fit_error


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
