"""From the FRF matrix of one pose to its modes, without an expert."""

from dataclasses import dataclass

import numpy as np

from planner.errors import RefusedError
from planner.frf.types import Frf
from planner.modes.plscf import plscf
from planner.modes.refine import Refined, refine
from planner.modes.residues import rank_one, synthesize
from planner.modes.stabilisation import Line, diagram, stable
from planner.modes.types import ModalModel, Mode

MAX_ORDER = 40
# Lines beyond the band that are fitted too, so that modes at its edges are met from both sides.
MARGIN = 0.15


@dataclass(frozen=True, eq=False)
class _Data:
    """What is fitted: measured columns on the lines used."""

    frequency_hz: np.ndarray
    accelerance: np.ndarray  # (3, columns, F)
    variance: np.ndarray | None  # (3, columns, F), None where unknown
    columns: np.ndarray


def estimate_modes(
    frf: Frf, band_hz: tuple[float, float], max_order: int = MAX_ORDER
) -> ModalModel:
    """All modes in `band_hz` (Hz), with standard deviations and probabilities.

    Raises RefusedError where no mode can be found.
    """
    data = _select_lines(frf, band_hz)
    orders = tuple(range(2, _order_limit(data, max_order) + 1))
    weight = None if data.variance is None else 1 / np.mean(data.variance, axis=1)
    sets = plscf(data.frequency_hz, data.accelerance, orders, weight)
    reach = (data.frequency_hz[0] * 0.95, data.frequency_hz[-1] * 1.05)
    lines = stable(diagram(sets, reach))
    if not lines:
        raise RefusedError(_nothing(band_hz))
    fit, scale = _fit(data, lines)
    modes = _modes(data, fit, scale, frf.exponential_rate_1_s)
    modes = [m for m in modes if band_hz[0] <= m.frequency_hz <= band_hz[1]]
    if not modes:
        raise RefusedError(_nothing(band_hz))
    error = data.accelerance - synthesize(data.frequency_hz, fit.poles, fit.residues)
    relative = float(np.linalg.norm(error) / np.linalg.norm(data.accelerance))
    return ModalModel(tuple(modes), band_hz, relative, max(orders))


def _nothing(band_hz: tuple[float, float]) -> str:
    return (
        f"No mode could be found between {band_hz[0]:g} and {band_hz[1]:g} Hz: hit harder or with"
        " a softer tip, or check that the band holds a resonance."
    )


def _select_lines(frf: Frf, band_hz: tuple[float, float]) -> _Data:
    usable = frf.usable_band_hz
    low = max(band_hz[0] / (1 + MARGIN), usable[0], 1e-9)
    high = min(band_hz[1] * (1 + MARGIN), usable[1])
    columns = np.flatnonzero(frf.measured)
    h = frf.accelerance[:, columns]
    chosen = (frf.frequency_hz >= low) & (frf.frequency_hz <= high)
    chosen &= np.all(np.isfinite(h), axis=(0, 1))
    if columns.size == 0 or np.count_nonzero(chosen) < 8:
        raise RefusedError(
            f"Only {np.count_nonzero(chosen)} usable frequency lines lie between {low:g} and"
            f" {high:g} Hz: record longer or hit with a harder tip."
        )
    variance = frf.variance[:, columns][..., chosen]
    known = np.all(np.isfinite(variance) & (variance > 0))
    return _Data(frf.frequency_hz[chosen], h[..., chosen], variance if known else None, columns)


def _order_limit(data: _Data, max_order: int) -> int:
    # Twice as many real equations per column as unknowns, at least.
    return max(2, min(max_order, data.frequency_hz.size // 3))


def _fit(data: _Data, lines: tuple[Line, ...]) -> tuple[Refined, float]:
    """Refined fit and the factor on its covariance (1 where the stated variance explains it)."""
    poles = np.array([line.pole for line in lines])
    flat = np.mean(np.abs(data.accelerance) ** 2, axis=-1, keepdims=True)
    variance = data.variance
    if variance is None:
        variance = np.broadcast_to(flat, data.accelerance.shape)
        first = refine(data.frequency_hz, data.accelerance, variance, poles)
        error = data.accelerance - synthesize(data.frequency_hz, first.poles, first.residues)
        flat = np.mean(np.abs(error) ** 2, axis=-1, keepdims=True) + 1e-24 * flat
        variance = np.broadcast_to(flat, data.accelerance.shape)
        poles = first.poles
    fit = refine(data.frequency_hz, data.accelerance, variance, poles)
    return fit, max(1.0, fit.chi2 / max(1, fit.degrees))


def _modes(data: _Data, fit: Refined, scale: float, rate_1_s: float) -> list[Mode]:
    """Modes in increasing frequency, poles shifted back by the rate of the window."""
    m = fit.poles.size
    modes = []
    for k in range(m):
        pole = fit.poles[k] + rate_1_s
        if pole.real >= 0:
            continue
        covariance = scale * fit.pole_covariance[np.ix_([k, m + k], [k, m + k])]
        frequency, damping, sd = _natural(pole, covariance)
        residue = np.full((3, 3), np.nan + 1j * np.nan)
        residue_sd = np.full((3, 3), np.nan)
        found = fit.residues.residue[..., k]
        residue[:, data.columns] = found
        variance = scale * fit.residue_variance[..., k]
        residue_sd[:, data.columns] = np.sqrt(np.mean(variance, axis=-1))
        shape = rank_one(found)[0]
        modes.append(Mode(frequency, sd[0], damping, sd[1], residue, residue_sd, shape))
    return sorted(modes, key=lambda mode: mode.frequency_hz)


def _natural(pole: complex, covariance: np.ndarray) -> tuple[float, float, np.ndarray]:
    """Natural frequency (Hz), damping ratio and their standard deviations (linearised)."""
    size = abs(pole)
    slope = np.array(
        [
            [pole.real / size / (2 * np.pi), pole.imag / size / (2 * np.pi)],
            [-(pole.imag**2) / size**3, pole.real * pole.imag / size**3],
        ]
    )
    spread = slope @ covariance @ slope.T
    return size / (2 * np.pi), -pole.real / size, np.sqrt(np.maximum(0.0, np.diag(spread)))
