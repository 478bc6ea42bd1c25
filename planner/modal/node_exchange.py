"""Which rows of a matrix stand under another point's name.

The column of a point says how it moves in each mode, and so does its row: where another row moves
so, the two were exchanged. Rows without a column are told by how their neighbours move.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from itertools import combinations

import numpy as np

from planner.frf.matrix import FrfMatrix
from planner.modal.estimate_modes import PoleIdentification
from planner.modal.motion_fields import RowPrediction, predicted_rows
from planner.modal.residues import realign
from planner.recording.points import Dof
from planner.recording.uff import Geometry


class RovingSides:
    """Rows are the points of the longer side (which roved), columns those that stayed.

    `table` (r, c, m): residues times 2iω_d, nearly real up to one phase for each mode; NaN where
    not measured. `hit` says whether the rows were hit (a roving hammer) or felt, `driving` are the
    (row, column) of points that were measured against themselves.
    """

    def __init__(self, matrix: FrfMatrix, found: PoleIdentification, modes: np.ndarray) -> None:
        """From residues of the modes (indices)."""
        values, side = found.fit.residue[:, modes] * 2j * found.fit.poles[modes].imag, matrix.roved
        self.table = np.full((*side.measured.shape, modes.size), np.nan + 0j)
        self.table[found.data.row, found.data.column] = values
        self.rows, self.columns = side.responses, side.references
        self.hit, self.driving = matrix.hit, side.driving

    @cached_property
    def motions(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Rows (r, m) and columns (c, m) of each mode, residue = row · column; None if too few.

        Columns come from complete rows, every row from what it has; NaN where it has nothing. The
        phase between the two sides is free: columns as real as can be leave real rows.
        """
        complete = np.all(np.isfinite(self.table), axis=(1, 2))
        # Least complete: rows measured at all columns, that tell how the columns move
        if np.count_nonzero(complete) < 3:
            return None
        each = np.moveaxis(self.table[complete], -1, 0)
        rights = np.linalg.svd(each, full_matrices=False)[2][:, 0]
        columns = np.array([right * realign(right) for right in rights]).T
        there = np.isfinite(self.table)
        power = np.sum(there * np.abs(columns) ** 2, axis=1)
        along = np.sum(np.where(there, self.table, 0.0) * columns.conj(), axis=1)
        rows = np.divide(along, power, out=np.full(along.shape, np.nan + 0j), where=power > 0)
        return rows, columns


# In surprise of the usual node: two exchanged nodes have more than SURPRISED each, less than
# EXPLAINED of theirs is left, an exchange of one of them with any other node brings less by CLEARER
# at least, turned signs at one node bring less than TURNED as much, and another exchange of one of
# them afterwards less than NEXT. Chosen on 60 frames, 25 panels and 25 pairs of bolted pieces
# (seeds 3000 ff.) with two nodes exchanged, three, signs turned, a row out of scale, and nothing.
SURPRISED, EXPLAINED, CLEARER, TURNED, NEXT = 2.0, 0.2, 2.0, 0.8, 1.0


def exchanged_nodes(
    dofs: Sequence[Dof], shapes: np.ndarray, geometry: Geometry
) -> tuple[str, str] | None:
    """Two nodes whose rows of shapes (n, m) fit each other's places, None where no two clearly do.

    Only nodes that were measured in the same directions.
    """
    found = predicted_rows(dofs, shapes, geometry)
    if found is None:
        return None
    rows: dict[str, dict[str, int]] = {}  # of each node, by direction
    placed = enumerate(dofs[k].positive for k in found.index)
    for row, dof in sorted(placed, key=lambda place: place[1].direction):
        rows.setdefault(dof.node, {})[dof.direction] = row
    nodes = [np.array(list(own.values())) for own in rows.values()]
    directions = [tuple(own) for own in rows.values()]
    gains = _gains(found, nodes, directions)
    a, b = (int(k) for k in np.unravel_index(np.argmax(gains), gains.shape))
    if not np.isfinite(gains[a, b]):
        return None
    surprise = _surprise(found, nodes)
    usual, before = float(np.median(surprise)), float(surprise[a] + surprise[b])
    values = found.values.copy()
    values[np.r_[nodes[a], nodes[b]]] = found.values[np.r_[nodes[b], nodes[a]]]
    after = replace(found, values=values)
    left = float(np.sum(_surprise(after, nodes)[[a, b]]))
    rivals = np.delete(gains[[a, b]], [a, b], axis=1)
    again = _gains(after, nodes, directions)
    clear = (
        before > 2 * SURPRISED * usual
        and left < EXPLAINED * before
        and np.max(rivals, initial=-np.inf) < gains[a, b] - CLEARER * usual
        and max(_turned(found, own) for own in nodes) < TURNED * gains[a, b]
        and np.max(again[[a, b]]) < NEXT * usual
    )
    first, second = sorted((a, b))  # which of both is rounding's
    return (list(rows)[first], list(rows)[second]) if clear else None


def _surprise(found: RowPrediction, nodes: Sequence[np.ndarray]) -> np.ndarray:
    """(n,) squared differences to what the others foretell, over their variance.

    Of nodes, given by their rows, over all modes and directions.
    """
    each = np.sum(found.pull**2, axis=1) / np.diag(found.precision)
    return np.array([np.sum(each[rows]) for rows in nodes])


def _gains(
    found: RowPrediction, nodes: Sequence[np.ndarray], directions: Sequence[tuple[str, ...]]
) -> np.ndarray:
    """(n, n) fall of −2 log likelihood where two nodes are exchanged, −∞ where they can't be."""
    gains = np.full((len(nodes), len(nodes)), -np.inf)
    for those in set(directions):
        alike = np.array([k for k, own in enumerate(directions) if own == those])
        a, b = alike[np.array(np.triu_indices(alike.size, 1))]
        one, other = (np.array([nodes[k] for k in part]) for part in (a, b))
        if a.size:
            values = found.values[np.concatenate([other, one], axis=1)]
            gains[a, b] = gains[b, a] = found.fall(np.concatenate([one, other], axis=1), values)
    return gains


def _turned(found: RowPrediction, node: np.ndarray) -> float:
    """The same where signs of a node's rows are turned, in whichever directions explain most."""
    sizes = range(1, node.size + 1)
    some = (np.array(rows) for size in sizes for rows in combinations(node, size))
    return max(float(found.fall(rows, -found.values[rows])) for rows in some)


# Two rows are called exchanged where rows and columns then differ by less than FITS, and by less
# than this share of what they do as stated and with any other two exchanged. Chosen on simulated
# plates and aeroplanes whose rows wander by 3 % in scale and 0.1 % in frequency.
FITS, BETTER = 0.3, 0.6


# Two points or nodes whose rows fit each other's places: a sentence, and whom it concerns.
Exchange = tuple[str, frozenset[Dof]]


def exchanged_by_neighbours(sides: RovingSides, geometry: Geometry | None) -> Exchange | None:
    """Nodes that were exchanged, in all their directions, told by their neighbours."""
    if sides.motions is None or geometry is None:
        return None
    pair = exchanged_nodes(sides.rows, sides.motions[0].real, geometry)
    if pair is None:
        return None
    text = (
        f"Nodes {pair[0]} and {pair[1]} are probably swapped: as labelled they move against "
        "the points around them in the modes, swapped they move with them. Check the labels."
    )
    concerned = (dof for dof in (*sides.rows, *sides.columns) if dof.node in pair)
    return text, frozenset(concerned)


def turning_helps(sides: RovingSides, turned: tuple[Dof, ...]) -> bool:
    """Whether columns and rows of the same points agree once turned columns are turned back."""
    if sides.motions is None or not turned:
        return False
    (shape, columns), (rows, stayed) = sides.motions, np.array(sides.driving).T
    sign = np.array([-1.0 if dof in turned else 1.0 for dof in sides.columns])
    return _misfit(shape, (sign[:, None] * columns)[stayed], rows) < FITS


def exchanged_by_columns(sides: RovingSides) -> Exchange | None:
    """Points that were exchanged, told by rows and columns of the same points."""
    if sides.motions is None or len(sides.driving) < 2:
        return None
    (shape, columns), (rows, stayed) = sides.motions, np.array(sides.driving).T
    weights = columns[stayed]
    stated = _misfit(shape, weights, rows)
    tried: dict[tuple[Dof, Dof], float] = {}
    for row in rows.tolist():
        for other, dof in enumerate(sides.rows):
            if other != row and dof.direction == sides.rows[row].direction:
                places = np.where(rows == row, other, np.where(rows == other, row, rows))
                pair = sides.rows[min(row, other)], sides.rows[max(row, other)]
                tried[pair] = _misfit(shape, weights, places)
    ranked = sorted(tried, key=lambda pair: tried[pair])
    if not ranked or tried[ranked[0]] > min(FITS, BETTER * stated):
        return None
    if len(ranked) > 1 and tried[ranked[1]] < tried[ranked[0]] / BETTER:
        return None
    a, b = ranked[0]
    text = (
        f"Nodes {a.node} and {b.node} ({a.direction}) are probably swapped: as labelled, hitting "
        f"and listening there differ by {100 * stated:.0f} %, swapped by {100 * tried[a, b]:.0f} %."
        " Check the labels."
    )
    return text, frozenset((a, b))


def _misfit(shape: np.ndarray, columns: np.ndarray, rows: np.ndarray) -> float:
    """Relative difference between how points move as columns and as rows, over all modes.

    The scale of each mode is free and positive up to a common phase: a shape of unit mass.
    """
    felt = shape[rows]
    if not np.all(np.isfinite(felt)):
        return 1.0
    # residue = row·column = φφ: column/row is a positive number where both are φ.
    along = np.maximum(np.sum(felt.conj() * columns, axis=0).real, 0.0)
    power = np.sum(np.abs(columns) ** 2, axis=0)
    wrong = power - along**2 / np.maximum(np.sum(np.abs(felt) ** 2, axis=0), 1e-300)
    return float(np.sqrt(max(np.sum(wrong), 0.0) / max(np.sum(power), 1e-300)))
