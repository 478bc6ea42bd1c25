"""From the FRF matrix of one pose to its modes, without an expert."""

import numpy as np

from planner.errors import RefusedError
from planner.frf.types import Frf
from planner.modes.fit import Data, Fit, fit, scales
from planner.modes.plscf import plscf
from planner.modes.residues import rank_one, synthesize
from planner.modes.stabilisation import diagram, stable
from planner.modes.types import ModalModel, Mode

MAX_ORDER = 40
# Lines beyond the band that are fitted too, so that modes at its edges are met from both sides.
MARGIN = 0.15


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
    found = fit(data, np.array([line.pole for line in lines]) + data.rate_1_s)
    modes = _modes(data, found)
    modes = [m for m in modes if band_hz[0] <= m.frequency_hz <= band_hz[1]]
    if not modes:
        raise RefusedError(_nothing(band_hz))
    error = data.accelerance - synthesize(
        data.frequency_hz, found.refined.poles, found.refined.residues, data.rate_1_s
    )
    relative = float(np.linalg.norm(error) / np.linalg.norm(data.accelerance))
    return ModalModel(tuple(modes), band_hz, relative, max(orders))


def _nothing(band_hz: tuple[float, float]) -> str:
    return (
        f"No mode could be found between {band_hz[0]:g} and {band_hz[1]:g} Hz: hit harder or with"
        " a softer tip, or check that the band holds a resonance."
    )


def _select_lines(frf: Frf, band_hz: tuple[float, float]) -> Data:
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
    return Data(frf.frequency_hz[chosen], h[..., chosen], variance if known else None, columns)


def _order_limit(data: Data, max_order: int) -> int:
    # Twice as many real equations per column as unknowns, at least.
    return max(2, min(max_order, data.frequency_hz.size // 3))


def _modes(data: Data, found: Fit) -> list[Mode]:
    """Modes in increasing frequency."""
    refined = found.refined
    m = refined.poles.size
    scale = scales(data, found)
    modes = []
    for k in range(m):
        index = [k, m + k]
        covariance = scale[k] * refined.pole_covariance[np.ix_(index, index)]
        frequency, damping, sd = _natural(complex(refined.poles[k]), covariance)
        residue = np.full((3, 3), np.nan + 1j * np.nan)
        residue_sd = np.full((3, 3), np.nan)
        value = refined.residues.residue[..., k]
        residue[:, data.columns] = value
        variance = scale[k] * refined.residue_variance[..., k]
        residue_sd[:, data.columns] = np.sqrt(np.mean(variance, axis=-1))
        shape = rank_one(value)[0]
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
