"""Searching the error of a fit for a mode that it lacks: a bank of matched filters."""

import numpy as np

from planner.modal.fit_data import Data
from planner.modal.residues import basis

# Damping ratios of the atoms with which the error is searched.
TRIAL_DAMPING = (0.003, 0.01, 0.03, 0.08)
# They are compared with the error over so many bandwidths around them (at least so many lines),
# so many atoms at once.
REACH, LEAST, BLOCK = 20.0, 8, 64


def falls(data: Data, weight: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Trial poles and the fall of χ² that each brings alone; error (entries, F) is weighted."""
    grids = _atoms(data)
    fall = [_falls_of(data, poles, weight, error) for poles in grids]
    return np.concatenate(grids), np.concatenate(fall)


def _falls_of(data: Data, poles: np.ndarray, weight: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Falls of atoms of one damping ratio, increasing in frequency, over the lines near each."""
    frequency = np.abs(poles) / (2 * np.pi)
    reach = REACH * (data.rate_1_s - poles.real) / (2 * np.pi)
    out = np.zeros(poles.size)
    for start in range(0, poles.size, BLOCK):
        block = slice(start, min(start + BLOCK, poles.size))
        low = np.searchsorted(data.frequency_hz, frequency[block][0] - reach[block][0])
        high = np.searchsorted(data.frequency_hz, frequency[block][-1] + reach[block][-1])
        near = slice(max(0, min(low, data.frequency_hz.size - LEAST)), max(high, LEAST))
        atoms = basis(data.lines.part(near), data.to_plane(poles[block]), False)
        first, second = atoms.reshape(2, atoms.shape[0] // 2, -1)
        aa = (np.abs(first) ** 2) @ weight[:, near].T
        bb = (np.abs(second) ** 2) @ weight[:, near].T
        ab = (first.conj() * second).real @ weight[:, near].T
        a = (first.conj() @ error[:, near].T).real
        b = (second.conj() @ error[:, near].T).real
        gain = (bb * a**2 - 2 * ab * a * b + aa * b**2) / (aa * bb - ab**2)
        out[block] = np.sum(gain, axis=1)
    return out


def _atoms(data: Data) -> list[np.ndarray]:
    """Trial poles, one array per damping ratio."""
    low, high = data.frequency_hz[0], data.frequency_hz[-1]
    step = data.frequency_hz[1] - data.frequency_hz[0]
    atoms = []
    for zeta in TRIAL_DAMPING:
        frequency, grid = low, []
        while frequency <= high:
            grid.append(frequency)
            frequency += max(step, 0.7 * zeta * frequency)
        omega = 2 * np.pi * np.array(grid)
        atoms.append(omega * (-zeta + 1j * np.sqrt(1 - zeta**2)))
    return atoms
