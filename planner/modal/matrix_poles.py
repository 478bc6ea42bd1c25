"""Poles of a matrix of FRFs of any size: many references at once, missing entries allowed."""

import numpy as np

from planner.errors import RefusedError
from planner.frf.matrix import FrfMatrix
from planner.modal.fit_data import Data
from planner.modal.mode_selection import fit, model
from planner.modal.plscf import PoleSet, plscf
from planner.modal.pole_identification import PoleIdentification, ladder, modes_of_fit
from planner.modal.stabilisation import diagram, stable

MARGIN = 0.05  # of the band, beyond its edges
MAX_ORDER = 36
MOST_REFERENCES = 6  # at once: the order of the polynomial counts for each of them
LEAST_LINES = 16


def identify_matrix(
    matrix: FrfMatrix, band_hz: tuple[float, float]
) -> tuple[PoleIdentification | None, np.ndarray, np.ndarray]:
    """Poles and residues (entries, 1); with row and column of each measured entry."""
    f = matrix.frequency_hz
    chosen = (f >= band_hz[0] / (1 + MARGIN)) & (f <= band_hz[1] * (1 + MARGIN))
    if np.count_nonzero(chosen) < LEAST_LINES:
        raise RefusedError(
            f"Only {np.count_nonzero(chosen)} frequency lines lie between {band_hz[0]:g} and"
            f" {band_hz[1]:g} Hz: widen the band or record longer."
        )
    rows, columns = np.nonzero(matrix.measured)
    values = matrix.accelerance[rows, columns][:, None, chosen]
    data = Data(f[chosen], values, None, pooled=True)
    sets = _pole_sets(matrix, chosen)
    found = diagram(sets, (f[chosen][0] * 0.95, f[chosen][-1] * 1.05))
    start = np.array([line.pole for line in stable(found)])
    if not start.size:
        return None, rows, columns
    fitted = fit(data, start, rounds=0)
    modes = modes_of_fit(data, fitted, sets)
    error = np.linalg.norm(data.response - model(data, fitted.refined))
    relative = float(error / np.linalg.norm(data.response))
    top = sets[-1].order
    made = PoleIdentification(modes, data, found, fitted, relative, top) if modes else None
    return made, rows, columns


def _pole_sets(matrix: FrfMatrix, chosen: np.ndarray) -> tuple[PoleSet, ...]:
    """Poles of every model order, from the rows that hold all of the references used."""
    table, measured = matrix.accelerance[..., chosen], matrix.measured
    if len(matrix.responses) < len(matrix.references):
        table, measured = np.swapaxes(table, 0, 1), measured.T
    columns = _references(measured)
    complete = np.all(measured[:, columns], axis=1)
    block = table[complete][:, columns]
    level = np.mean(np.abs(block) ** 2, axis=(1, 2))
    weight = np.ones(block.shape[::2]) / np.maximum(level, 1e-300)[:, None]
    top = max(2, min(MAX_ORDER, block.shape[-1] // 3))
    return plscf(matrix.frequency_hz[chosen], block, ladder(top), weight)


def _references(measured: np.ndarray) -> np.ndarray:
    """Columns of measured (o, i) used together: as many FRFs as possible in complete rows."""
    columns = list(np.argsort(-np.sum(measured, axis=0), kind="stable"))
    best, size = columns[:1], 0
    for count in range(1, min(len(columns), MOST_REFERENCES) + 1):
        complete = int(np.sum(np.all(measured[:, columns[:count]], axis=1))) * count
        if complete > size:
            best, size = columns[:count], complete
    return np.array(best)
