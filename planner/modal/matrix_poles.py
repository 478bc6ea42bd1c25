"""Poles of a matrix of FRFs of any size: many references at once, missing entries allowed."""

from dataclasses import dataclass

import numpy as np

from planner.frf.matrix import FrfMatrix
from planner.modal.estimate_modes import ladder
from planner.modal.fit_data import Data, too_few_lines
from planner.modal.matrix_selection import first_variance, judged, select_modes
from planner.modal.plscf import Diagram, PoleSet, diagram, plscf, row_errors, stable
from planner.modal.set_poles import SetPoles

MARGIN = 0.05  # of the band, beyond its edges
# Of rows that fit the denominator of all the worse than the median by more than this, the weight is
# taken down, so many times over; fewer rows than these cannot tell.
ODD, REWEIGHED, LEAST_ROWS = 3.0, 3, 6


@dataclass(frozen=True, eq=False)
class MatrixPoles:
    """Poles common to all FRFs and what they came from; entries by `rows` and `columns`.

    Rows are the points of the longer side (which roved), `hit` or felt; columns those that stayed.

    `fit.residue` (e, m) of each entry; `scale` (m,) by which noise around a mode exceeds its
    variance; `weak` (m,) as `mode_selection.weakness`, `presence` (m,) share of the response.
    """

    data: Data
    fit: SetPoles
    diagram: Diagram
    rows: np.ndarray
    columns: np.ndarray
    scale: np.ndarray
    weak: np.ndarray
    presence: np.ndarray
    order: int
    hit: bool

    @property
    def entries(self) -> dict[tuple[int, int], int]:
        """Which entry is that of a response and a reference (indices)."""
        pairs = zip(self.rows.tolist(), self.columns.tolist(), strict=True)
        return {pair[::-1] if self.hit else pair: e for e, pair in enumerate(pairs)}

    @property
    def fit_error(self) -> float:
        """‖H − fit‖/‖H‖."""
        error = np.linalg.norm(self.data.response[:, 0] - self.fit.fitted)
        return float(error / np.linalg.norm(self.data.response))


def identify_matrix(matrix: FrfMatrix, band_hz: tuple[float, float]) -> MatrixPoles | None:
    """All poles that the matrix holds in and right beside a band; None where there is none.

    Raises RefusedError where too few lines lie in the band.
    """
    hit, matrix = matrix.hit, matrix.roved
    f = matrix.frequency_hz
    chosen = (f >= band_hz[0] / (1 + MARGIN)) & (f <= band_hz[1] * (1 + MARGIN))
    # Least lines.
    if np.count_nonzero(chosen) < 16:
        raise too_few_lines(chosen, f, band_hz)
    rows, columns = np.nonzero(matrix.measured)
    response = matrix.accelerance[rows, columns][:, None, chosen]
    rate = matrix.exponential_rate_1_s
    data = Data(f[chosen], response, None, rate, tail_s=matrix.tail_s, near=True, above=True)
    # A record cut off while it rings leaves ripples, which polynomials take for poles.
    smooth = matrix.ended or matrix
    orders, found = _diagram(smooth, chosen)
    start = np.array([line.pole for line in stable(found)]) + smooth.exponential_rate_1_s
    if not start.size:
        return None
    start = data.with_one_above(start)
    # Entries measured together: those of one node of the side that roved
    nodes = np.array([matrix.responses[k].node for k in rows])
    sets = tuple(np.flatnonzero(nodes == node) for node in dict.fromkeys(nodes.tolist()))
    fit, variance = select_modes(data, sets, first_variance(data, start), start, (rows, columns))
    if not fit.poles.size:
        return None
    scale, weak, presence = judged(data, fit, variance)
    told = scale, weak, presence, orders[-1], hit
    return MatrixPoles(data, fit, found, rows, columns, *told)


def _diagram(matrix: FrfMatrix, chosen: np.ndarray) -> tuple[tuple[int, ...], Diagram]:
    """Poles of every model order, from the rows that hold all of the references used."""
    table, measured = matrix.accelerance[..., chosen], matrix.measured
    columns = _references(measured)
    complete = np.all(measured[:, columns], axis=1)
    block = table[complete][:, columns]
    level = np.mean(np.abs(block) ** 2, axis=(1, 2))
    weight = np.ones(block.shape[::2]) / np.maximum(level, 1e-300)[:, None]
    # Max order.
    orders = ladder(max(2, min(36, block.shape[-1] // 3)))
    frequency = matrix.frequency_hz[chosen]
    weight = _without_odd_rows(frequency, block, orders[-1], weight)
    sets: tuple[PoleSet, ...] = plscf(frequency, block, orders, weight)
    return orders, diagram(sets, (frequency[0] * 0.95, frequency[-1] * 1.05))


def _without_odd_rows(
    frequency: np.ndarray, block: np.ndarray, order: int, weight: np.ndarray
) -> np.ndarray:
    """Weights (o, F) with those rows taken down that do not go with the others."""
    if block.shape[0] < LEAST_ROWS or block.shape[1] < 2:
        return weight
    changed = weight
    for _ in range(REWEIGHED):
        errors = row_errors(frequency, block, order, changed)
        usual = max(float(np.median(errors)), 1e-300)
        changed = weight * np.minimum(1.0, ODD * usual / np.maximum(errors, 1e-300))[:, None] ** 2
    return changed


def _references(measured: np.ndarray) -> np.ndarray:
    """Columns of measured (o, i) used together: as many FRFs as possible in complete rows."""
    columns = list(np.argsort(-np.sum(measured, axis=0), kind="stable"))
    best, size = columns[:1], 0
    # Most references at once: the order of the polynomial counts for each of them
    for count in range(1, min(len(columns), 6) + 1):
        complete = int(np.sum(np.all(measured[:, columns[:count]], axis=1))) * count
        if complete > size:
            best, size = columns[:count], complete
    return np.array(best)
