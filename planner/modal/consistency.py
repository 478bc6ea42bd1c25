"""Do the FRFs of a matrix fit one another? Driving points, reciprocity, signs, nodes' places.

A passive structure takes power in where it is hit, so that the imaginary part of a driving point's
accelerance is nowhere negative, and each mode's residue has one sign there: between two
resonances lies an antiresonance. Maxwell: H_ij = H_ji. Between the columns of a matrix a mode has
one shape. What is turned, exchanged or out of scale breaks one of these, and is named where only
one explanation does.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from planner.frf.matrix import FrfMatrix
from planner.modal.matrix_poles import MatrixPoles
from planner.modal.residues import realign
from planner.recording.dof import Dof

# A sign or a place is called wrong where the modes' residues agree with what is called right by
# so much (correlation over modes), and disagree with what is stated.
SURE, DOUBTED = 0.9, 0.3
# Reciprocity is remarked upon where H_ij and H_ji differ by more than this.
RECIPROCAL = 0.15
# Two rows are called exchanged where rows and columns then differ by less than FITS, and by less
# than this share of what they do as stated and with any other two exchanged. Chosen on simulated
# plates and aeroplanes whose rows wander by 3 % in scale and 0.1 % in frequency.
FITS, BETTER = 0.3, 0.6
# An FRF whose scale differs by more from that of the others in its row and column is remarked.
SCALE = 0.25
LEAST_MODES = 3  # that tell of signs and places


@dataclass(frozen=True)
class DrivingPoint:
    """A point hit where it was felt; shares in [0, 1].

    `positive` is the share of |Im H| that has the right sign, `modes` that of the modes' residues.
    """

    dof: Dof
    positive: float
    modes: float

    @property
    def right(self) -> bool:
        """Whether its sign is as a structure's must be."""
        return self.modes > 0.5


@dataclass(frozen=True)
class Reciprocity:
    """H_ij beside H_ji: relative difference, and their ratio (least squares; −1: a turned sign)."""

    first: Dof
    second: Dof
    difference: float
    ratio: float


@dataclass(frozen=True)
class Exchange:
    """Two points whose rows fit each other's places; relative misfits as stated and exchanged."""

    first: Dof
    second: Dof
    stated: float
    exchanged: float

    @property
    def text(self) -> str:
        """One sentence for the engineer."""
        a, b = self.first, self.second
        return (
            f"Node {a.node}'s and node {b.node}'s rows ({a.direction}) fit each other's places: "
            f"with them exchanged, hitting there and feeling there agree to"
            f" {100 * self.exchanged:.0f} %, as stated they differ by {100 * self.stated:.0f} %;"
            " were the two exchanged?"
        )


@dataclass(frozen=True, eq=False)
class Consistency:
    """What the checks say; `faults` are the sentences about what is wrong, `remarks` the rest.

    `turned` are references whose column has the wrong sign, `untied` those whose column does not
    go with the row of the same point.
    """

    driving: tuple[DrivingPoint, ...]
    reciprocity: tuple[Reciprocity, ...]
    faults: tuple[str, ...]
    remarks: tuple[str, ...]
    turned: tuple[Dof, ...] = ()
    untied: tuple[Dof, ...] = ()


def check(matrix: FrfMatrix, found: MatrixPoles, modes: np.ndarray) -> Consistency:
    """Check FRFs and residues of the modes (indices) that were established."""
    table = _table(matrix, found, modes)
    lines = _lines(matrix, found)
    driving = tuple(_driving(matrix, table, lines, o, i) for o, i in matrix.driving)
    pairs = _pairs(matrix)
    reciprocity = tuple(_reciprocity(matrix, lines, *pair) for pair in pairs)
    turned = tuple(point.dof for point in driving if point.modes < DOUBTED)
    swapped: tuple[Exchange, ...] = ()
    if modes.size >= LEAST_MODES and not _turning_helps(matrix, table, turned):
        swapped = _swapped(matrix, table)
    turned = () if swapped else turned
    faults = [exchange.text for exchange in swapped]
    faults += _turned(turned, len(driving), reciprocity)
    faults += _odd_entries(matrix, table) if modes.size >= LEAST_MODES else []
    untied = tuple(dof for e in swapped for dof in (e.first, e.second))
    told = () if faults else _remarks(reciprocity)
    if not driving:
        told = (*told, "No point was hit where it was felt: shapes are not scaled.")
    return Consistency(driving, reciprocity, tuple(faults), told, turned, untied)


def _lines(matrix: FrfMatrix, found: MatrixPoles) -> np.ndarray:
    low, high = found.data.frequency_hz[[0, -1]]
    return (matrix.frequency_hz >= low) & (matrix.frequency_hz <= high)


def _table(matrix: FrfMatrix, found: MatrixPoles, modes: np.ndarray) -> np.ndarray:
    """(o, i, m) residues times 2iω_d, nearly real; NaN where not measured.

    Each mode is turned by the phase that all of it has in common.
    """
    values = found.fit.residue[:, modes] * 2j * found.fit.poles[modes].imag
    table = np.full((*matrix.measured.shape, modes.size), np.nan + 0j)
    table[found.rows, found.columns] = values
    return table


def _driving(
    matrix: FrfMatrix, table: np.ndarray, lines: np.ndarray, o: int, i: int
) -> DrivingPoint:
    imag = np.imag(matrix.accelerance[o, i, lines])
    size = np.abs(table[o, i])
    modes = float(np.sum(size[np.real(table[o, i]) > 0]) / max(np.sum(size), 1e-300))
    positive = float(np.sum(imag[imag > 0]) / max(np.sum(np.abs(imag)), 1e-300))
    return DrivingPoint(matrix.references[i], positive, modes)


def _pairs(matrix: FrfMatrix) -> list[tuple[int, int, int, int]]:
    """(o, i, o', i') of entries measured both ways."""
    both = [(i, dof) for i, dof in enumerate(matrix.references) if dof in matrix.responses]
    found = []
    for (i, a), (j, b) in combinations(both, 2):
        at = matrix.index(b), i, matrix.index(a), j
        if matrix.measured[at[:2]] and matrix.measured[at[2:]]:
            found.append(at)
    return found


def _reciprocity(
    matrix: FrfMatrix, lines: np.ndarray, o: int, i: int, p: int, j: int
) -> Reciprocity:
    one, other = matrix.accelerance[o, i, lines], matrix.accelerance[p, j, lines]
    size = np.linalg.norm(one) * np.linalg.norm(other)
    ratio = float(np.real(np.vdot(one, other)) / max(np.linalg.norm(one) ** 2, 1e-300))
    apart = float(np.linalg.norm(one - other) / max(np.sqrt(size), 1e-300))
    return Reciprocity(matrix.responses[o], matrix.references[i], apart, ratio)


def _turned(
    wrong: tuple[Dof, ...], driving: int, reciprocity: tuple[Reciprocity, ...]
) -> list[str]:
    """Sentences about channels whose sign is turned."""
    if len(wrong) == driving > 1:
        return [
            "All driving points have the wrong sign (Im H < 0 at resonances): the force, or all "
            "responses, were measured with a turned sign. They are taken turned back."
        ]
    sentences = []
    for dof in wrong:
        others = [r for r in reciprocity if dof in (r.first, r.second) and r.ratio < 0]
        more = f" and {len(others)} × H_ij = −H_ji" if others else ""
        sentences.append(
            f"The sign of the channel at {_place(dof)} is turned: its driving point has Im H < 0 "
            f"at resonances{more}. All FRFs with this reference are taken turned back."
        )
    return sentences


def _place(dof: Dof) -> str:
    return f"node {dof.node}, {dof.direction}"


def _turning_helps(matrix: FrfMatrix, table: np.ndarray, turned: tuple[Dof, ...]) -> bool:
    """Whether columns and rows of driving points agree once the turned columns are turned back."""
    shape, columns = _shapes(table)
    if shape is None or columns is None or not turned:
        return False
    sign = np.array([-1.0 if dof in turned else 1.0 for dof in matrix.references])
    hit = [i for _, i in matrix.driving]
    rows = [o for o, _ in matrix.driving]
    return _place_misfit(shape, (sign[:, None] * columns)[hit], rows) < FITS


def _swapped(matrix: FrfMatrix, table: np.ndarray) -> "tuple[Exchange, ...]":
    """Nodes whose rows fit each other's places: a column's place is told by the row that it needs.

    The column of a reference says how its point moves in each mode, and so does the row of that
    point. Where it is another row that moves so, the two were exchanged.
    """
    rows = [o for o, _ in matrix.driving]
    columns = [i for _, i in matrix.driving]
    if len(rows) < 2:
        return ()
    shape, weights = _shapes(table)
    if shape is None or weights is None:
        return ()
    stated = _place_misfit(shape, weights[columns], rows)
    tried: dict[tuple[Dof, Dof], float] = {}
    for row in rows:
        for other, dof in enumerate(matrix.responses):
            if other != row and dof.direction == matrix.responses[row].direction:
                places = [other if r == row else row if r == other else r for r in rows]
                pair = matrix.responses[min(row, other)], matrix.responses[max(row, other)]
                tried[pair] = _place_misfit(shape, weights[columns], places)
    ranked = sorted(tried, key=lambda pair: tried[pair])
    if not ranked or tried[ranked[0]] > min(FITS, BETTER * stated):
        return ()
    if len(ranked) > 1 and tried[ranked[1]] < tried[ranked[0]] / BETTER:
        return ()
    return (Exchange(*ranked[0], stated, tried[ranked[0]]),)


def _shapes(table: np.ndarray) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Rows (o, m) and columns (i, m) of each mode: residue = row·column, from complete rows."""
    complete = np.all(np.isfinite(table), axis=(1, 2))
    if np.count_nonzero(complete) < 3:
        return None, None
    o, i, m = table.shape
    rows, columns = np.full((o, m), np.nan + 0j), np.zeros((i, m), complex)
    for k in range(m):
        left, size, right = np.linalg.svd(table[complete, :, k], full_matrices=False)
        # The phase between the two sides is free; columns as real as can be leave real rows.
        turn = realign(right[0])
        rows[complete, k] = left[:, 0] * size[0] / turn
        columns[:, k] = right[0] * turn
    return rows, columns


def _place_misfit(shape: np.ndarray, columns: np.ndarray, rows: list[int]) -> float:
    """Relative difference between how references move as columns and as rows, over all modes.

    The scale of each mode is free and positive up to a common phase: a shape of unit mass.
    """
    felt = shape[rows]
    if not np.all(np.isfinite(felt)):
        return 1.0
    wrong = total = 0.0
    for k in range(felt.shape[1]):
        a, b = columns[:, k], felt[:, k]
        size = np.linalg.norm(a) * np.linalg.norm(b)
        # residue = row·column = φφ: column/row is a positive number where both are φ.
        along = np.real(np.vdot(b, a)) if size else 0.0
        power = np.linalg.norm(a) ** 2
        wrong += power - max(along, 0.0) ** 2 / max(np.linalg.norm(b) ** 2, 1e-300)
        total += power
    return float(np.sqrt(max(wrong, 0.0) / max(total, 1e-300)))


def _odd_entries(matrix: FrfMatrix, table: np.ndarray) -> list[str]:
    """Single FRFs that do not fit the shapes that the others of their row and column have."""
    o, i, _ = table.shape
    if min(o, i) < 2 or max(o, i) < 4:
        return []
    rows, columns = _shapes(table)
    if rows is None or columns is None:
        return []
    sentences = []
    for row in range(o):
        for column in range(i):
            ratio = _ratio(table, columns, row, column)
            if ratio is not None and ratio < SCALE - SURE:
                sentences.append(
                    f"The FRF felt at {_place(matrix.responses[row])} and hit at "
                    f"{_place(matrix.references[column])} has a turned sign beside the others of "
                    "its row; check its polarity."
                )
    return sentences if len(sentences) <= 0.2 * o * i else []


def _ratio(table: np.ndarray, columns: np.ndarray, row: int, column: int) -> float | None:
    """An FRF's residues over those that the rest of its row asks for; None where it says nothing.

    The rest of the row tells how the point moves; the columns tell what that makes at `column`.
    """
    rest = [c for c in range(table.shape[1]) if c != column and np.isfinite(table[row, c, 0])]
    if len(rest) < 2 or not np.isfinite(table[row, column, 0]):
        return None
    a, b = columns[rest], table[row, rest]
    point = np.sum(a.conj() * b, axis=0) / np.maximum(np.sum(np.abs(a) ** 2, axis=0), 1e-300)
    expected, seen = point * columns[column], table[row, column]
    left = np.linalg.norm(b - point * a) / max(np.linalg.norm(b), 1e-300)
    size = np.linalg.norm(expected) ** 2
    if left > SCALE or size == 0:
        return None
    ratio = float(np.real(np.vdot(expected, seen)) / size)
    apart = np.linalg.norm(seen - ratio * expected) / max(np.linalg.norm(seen), 1e-300)
    return ratio if apart < SCALE else None


def _remarks(reciprocity: tuple[Reciprocity, ...]) -> tuple[str, ...]:
    worst = max(reciprocity, key=lambda r: r.difference, default=None)
    if worst is None or worst.difference < RECIPROCAL:
        return ()
    return (
        f"Between {_place(worst.first)} and {_place(worst.second)} H_ij and H_ji differ by "
        f"{100 * worst.difference:.0f} % (ratio {worst.ratio:.2f}).",
    )
