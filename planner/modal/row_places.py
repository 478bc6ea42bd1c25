"""Rows of a matrix under a wrong sign, where only the places of the points show it.

How a point should move in all modes is foretold from the others, each left out in turn. A row that
is the opposite of what is foretold was measured with a turned sign.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.modal.motion_fields import NUGGET, motion_fields
from planner.recording.dof import Dof
from planner.recording.geometry import Geometry

LEAST_ROWS, LEAST_MODES = 8, 3
# A row is turned where the squared difference to what is foretold is less than this, with the sign
# turned, and more than this as stated, relative to the row's own square, and where turning another
# row brings less than SECOND as much. Chosen on panels, frames and bolted pieces, none of whose
# right rows came near; the clearest was another row where that brought 0.86 as much, never below.
TURNED, STATED, SECOND = 0.35, 2.0, 0.8
LEAST_MOTION = 0.3  # of the mean over all rows: points that hardly move say nothing
MOST = 0.1  # share of rows that can be wrong: beyond, the geometry is


@dataclass(frozen=True, eq=False)
class Foretold:
    """Rows that have a place: `index` (n,) of them, values (n, m), precision (n, n) over rows."""

    index: np.ndarray
    values: np.ndarray
    precision: np.ndarray

    @property
    def surprise(self) -> np.ndarray:
        """(n, m) difference to what the others foretell, squared, over its variance."""
        return (self.precision @ self.values) ** 2 / np.diag(self.precision)[:, None]

    @property
    def gain(self) -> np.ndarray:
        """(n,) fall of −2 log likelihood where a row is turned."""
        slope = np.sum(self.values * (self.precision @ self.values), axis=1)
        return 4 * (slope - np.sum(self.values**2, axis=1) * np.diag(self.precision))

    def turning(self) -> tuple[np.ndarray, np.ndarray]:
        """(n,) relative squared difference to what is foretold: as stated, and turned."""
        off = (self.precision @ self.values) / np.diag(self.precision)[:, None]
        power = np.maximum(np.sum(self.values**2, axis=1), 1e-300)
        turned = np.sum((2 * self.values - off) ** 2, axis=1)
        return np.sum(off**2, axis=1) / power, turned / power


def foretold(dofs: Sequence[Dof], shapes: np.ndarray, geometry: Geometry) -> Foretold | None:
    """What the places foretell of rows (n, m) real, NaN where unknown; None where they are few.

    Each mode is over its usual error, each row left out in turn, by the likeliest of several
    fields: smooth modes count more.
    """
    index = np.array(
        [
            k for k, dof in enumerate(dofs)
            if geometry.at(dof.node) is not None and np.all(np.isfinite(shapes[k]))
        ], int,
    )  # fmt: skip
    if index.size < LEAST_ROWS or shapes.shape[1] < LEAST_MODES:
        return None
    values = shapes[index] / np.maximum(np.sqrt(np.mean(shapes[index] ** 2, axis=0)), 1e-300)
    best, found = -np.inf, None
    for covariance in motion_fields([dofs[k] for k in index], geometry):
        precision = np.linalg.inv(covariance + NUGGET**2 * np.eye(index.size))
        spread = np.diag(precision)
        square = (precision @ values) ** 2 / spread[:, None]
        # The usual error, not the mean: wrong rows are among them. No error is less than a row's.
        usual = np.median(square, axis=0) / 0.455
        usual = np.maximum(usual, 0.1 * np.median(usual))
        likely = float(np.sum(np.log(spread[:, None] / usual) - np.minimum(square / usual, 9.0)))
        if likely > best:
            best, found = likely, Foretold(index, values / np.sqrt(usual), precision)
    return found


def turned_rows(dofs: Sequence[Dof], shapes: np.ndarray, geometry: Geometry) -> tuple[int, ...]:
    """Rows (indices) whose sign is turned; the clearest is turned before the next is looked for."""
    shapes, turned = shapes.copy(), []
    size = np.sum(shapes**2 / np.nanmean(shapes**2, axis=0), axis=1)
    for _ in range(int(MOST * len(dofs)) + 1):
        found = foretold(dofs, shapes, geometry)
        if found is None:
            return ()
        row = _clearest(found, size > LEAST_MOTION**2 * np.nanmean(size))
        if row is None or row in turned:
            return tuple(turned)
        turned.append(row)
        shapes[row] *= -1
    return ()


def _clearest(found: Foretold, moves: np.ndarray) -> int | None:
    """The row (index) that is clearly turned, None where none is or another might be instead."""
    gain = found.gain
    k = int(np.argmax(gain))
    stated, turned = found.turning()
    if turned[k] > TURNED or stated[k] < STATED or not moves[found.index[k]]:
        return None
    values = found.values.copy()
    values[k] *= -1
    after = Foretold(found.index, values, found.precision).gain
    # Another row might be turned instead if little is left for it once this one is turned.
    rival = (gain > SECOND * gain[k]) & (after < gain / 2)
    return int(found.index[k]) if np.count_nonzero(rival) <= 1 else None
