"""A matrix of FRFs by its sides: what roved, and what stayed; residues as rows and columns."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.frf.matrix import FrfMatrix
from planner.modal.matrix_poles import MatrixPoles
from planner.modal.residues import realign
from planner.recording.dof import Dof

LEAST_COMPLETE = 3  # rows measured at all columns, that tell how the columns move


@dataclass(frozen=True, eq=False)
class Sides:
    """Rows are the points of the longer side (which roved), columns those that stayed.

    `table` (r, c, m): residues times 2iω_d, nearly real up to one phase for each mode; NaN where
    not measured. `hit` says whether the rows were hit (a roving hammer) or felt.
    """

    rows: tuple[Dof, ...]
    columns: tuple[Dof, ...]
    table: np.ndarray
    hit: bool

    @classmethod
    def of(cls, matrix: FrfMatrix, found: MatrixPoles, modes: np.ndarray) -> "Sides":
        """From residues of the modes (indices)."""
        values = found.fit.residue[:, modes] * 2j * found.fit.poles[modes].imag
        table = np.full((*matrix.measured.shape, modes.size), np.nan + 0j)
        table[found.rows, found.columns] = values
        if len(matrix.responses) >= len(matrix.references):
            return cls(matrix.responses, matrix.references, table, False)
        return cls(matrix.references, matrix.responses, np.swapaxes(table, 0, 1), True)

    @property
    def driving(self) -> tuple[tuple[int, int], ...]:
        """(row, column) of points that were measured against themselves."""
        places = {dof: k for k, dof in enumerate(self.rows)}
        found = ((places[d], i) for i, d in enumerate(self.columns) if d in places)
        return tuple(pair for pair in found if np.isfinite(self.table[pair][0]))

    @cached_property
    def motions(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Rows (r, m) and columns (c, m) of each mode, residue = row · column; None if too few.

        Columns come from complete rows, every row from what it has; NaN where it has nothing. The
        phase between the two sides is free: columns as real as can be leave real rows.
        """
        complete = np.all(np.isfinite(self.table), axis=(1, 2))
        if np.count_nonzero(complete) < LEAST_COMPLETE:
            return None
        _, count, modes = self.table.shape
        columns = np.zeros((count, modes), complex)
        for k in range(modes):
            right = np.linalg.svd(self.table[complete, :, k], full_matrices=False)[2][0]
            columns[:, k] = right * realign(right)
        there = np.isfinite(self.table)
        power = np.sum(there * np.abs(columns) ** 2, axis=1)
        along = np.sum(np.where(there, self.table, 0.0) * columns.conj(), axis=1)
        rows = np.divide(along, power, out=np.full(along.shape, np.nan + 0j), where=power > 0)
        return rows, columns
