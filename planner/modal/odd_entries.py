"""Single FRFs that do not fit the shapes that the others of their row and column have."""

from itertools import combinations

import numpy as np

from planner.modal.matrix_sides import Sides

# An entry fits where its residues differ from what the rest of its row asks for by less than this,
# over all modes; what turned it round differs by more than the second as stated.
FITS, ODD = 0.3, 1.0
MOST = 0.2  # share of entries that can be odd: beyond, what they are compared with is


def odd_entries(sides: Sides) -> tuple[list[str], list[tuple[int, int]]]:
    """FRFs with a turned sign, and two of a column that are exchanged: sentences and entries."""
    expected = _expected(sides)
    if expected is None:
        return [], []
    seen = sides.table
    size = np.maximum(np.linalg.norm(expected, axis=-1), 1e-300)
    stated = np.linalg.norm(seen - expected, axis=-1) / size
    turned = np.linalg.norm(seen + expected, axis=-1) / size
    wrong = [(a, b) for a, b in np.argwhere((turned < FITS) & (stated > ODD)).tolist()]
    sentences = [
        f"The FRF {_named(sides, row, column)} has a turned sign beside the others of its row and "
        "was left out; check its polarity."
        for row, column in wrong
    ]
    for column in range(len(sides.columns)):
        odd = np.flatnonzero((stated[:, column] > ODD / 2) & (turned[:, column] > FITS))
        for a, b in combinations(odd.tolist(), 2):
            off = np.linalg.norm(seen[[a, b], column] - expected[[b, a], column], axis=-1)
            if np.all(off < FITS * size[[b, a], column]):
                wrong += [(a, column), (b, column)]
                sentences.append(
                    f"The FRFs {_named(sides, a, column)} and {_named(sides, b, column)} are "
                    "probably swapped and were left out. Check the labels."
                )
    few = len(sentences) <= MOST * np.count_nonzero(np.isfinite(stated))
    return (sentences, wrong) if few else ([], [])


def _expected(sides: Sides) -> np.ndarray | None:
    """(r, c, m) of each entry what the rest of its row asks for; NaN where that says nothing.

    The rest of the row tells how the point moves; the columns tell what that makes here.
    """
    if sides.motions is None or len(sides.columns) < 3 or len(sides.rows) < 4:
        return None
    columns, seen = sides.motions[1], sides.table
    expected = np.full(seen.shape, np.nan + 0j)
    for row, column in np.argwhere(np.isfinite(seen[..., 0])):
        others = [c for c in range(len(columns)) if c != column and np.isfinite(seen[row, c, 0])]
        if len(others) < 2:
            continue
        a, b = columns[others], seen[row, others]
        point = np.sum(a.conj() * b, axis=0) / np.maximum(np.sum(np.abs(a) ** 2, axis=0), 1e-300)
        if np.linalg.norm(b - point * a) < FITS * np.linalg.norm(b):
            expected[row, column] = point * columns[column]
    return expected


def _named(sides: Sides, row: int, column: int) -> str:
    one, other = sides.rows[row].at, sides.columns[column].at
    felt, hit = (other, one) if sides.hit else (one, other)
    return f"felt {felt} and hit {hit}"
