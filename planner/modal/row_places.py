"""Rows of a matrix under a wrong sign or name, where only the places of the points show it.

How a point should move in all modes is foretold from the others, each left out in turn. A row that
is the opposite of what is foretold was measured with a turned sign; two nodes whose rows fit each
other's places, and not their own, were exchanged.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from planner.modal.motion_fields import NUGGET, motion_fields
from planner.recording.dof import Dof
from planner.recording.geometry import Geometry

LEAST_ROWS, LEAST_MODES = 8, 3
# A row is turned where the squared difference to what is foretold is less than this, with the sign
# turned, and more than this as stated, relative to the row's own square, and where turning another
# row brings less than RIVAL as much. Chosen on panels, frames
# and bolted pieces (seeds 100 to 117) none of whose right rows came near.
TURNED, STATED = 0.35, 2.0
LEAST_MOTION = 0.3  # of the mean over all rows: points that hardly move say nothing
# Two nodes are exchanged where their surprise is at least SURPRISED times that of the usual node,
# is less than EXPLAINED of that after the exchange, and an exchange of one of them with any other
# brings less than RIVAL as much. Chosen as above; the few likeliest are looked at.
SURPRISED, EXPLAINED, RIVAL, LIKELIEST = 4.0, 0.3, 0.67, 12
MOST = 0.1  # share of rows that can be wrong: beyond, the geometry is


@dataclass(frozen=True, eq=False)
class Foretold:
    """Rows of one direction: `index` (n,) of them, values (n, m), precision (n, n) over rows."""

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


def foretold(dofs: Sequence[Dof], shapes: np.ndarray, geometry: Geometry) -> tuple[Foretold, ...]:
    """What the places foretell of rows (n, m) real, NaN where unknown; one for each direction."""
    found = []
    for direction in sorted({dof.positive.direction for dof in dofs}):
        index = np.array(
            [
                k for k, dof in enumerate(dofs)
                if dof.positive.direction == direction and geometry.at(dof.node) is not None
                and np.all(np.isfinite(shapes[k]))
            ], int,
        )  # fmt: skip
        if index.size >= LEAST_ROWS and shapes.shape[1] >= LEAST_MODES:
            nodes = [dofs[k].node for k in index]
            size = np.sqrt(np.mean(shapes[index] ** 2, axis=0))
            values = shapes[index] / np.maximum(size, 1e-300)
            found.append(Foretold(index, *_likeliest(nodes, values, geometry)))
    return tuple(found)


def _likeliest(
    nodes: list[str], values: np.ndarray, geometry: Geometry
) -> tuple[np.ndarray, np.ndarray]:
    """Values (n, m), each mode over its usual error, and the precision (n, n) of the best field.

    The likeliest of several fields, each row left out in turn. Smooth modes then count more.
    """
    best, found = -np.inf, (values, np.eye(len(nodes)))
    for covariance in motion_fields(nodes, geometry):
        precision = np.linalg.inv(covariance + NUGGET**2 * np.eye(len(nodes)))
        spread = np.diag(precision)
        square = (precision @ values) ** 2 / spread[:, None]
        # The usual error, not the mean: wrong rows are among them. No error is less than a row's.
        usual = np.median(square, axis=0) / 0.455
        usual = np.maximum(usual, 0.1 * np.median(usual))
        likely = float(np.sum(np.log(spread[:, None] / usual) - np.minimum(square / usual, 9.0)))
        if likely > best:
            best, found = likely, (values / np.sqrt(usual), precision)
    return found


def turned_rows(dofs: Sequence[Dof], shapes: np.ndarray, geometry: Geometry) -> tuple[int, ...]:
    """Rows (indices) whose sign is turned; the clearest is turned before the next is looked for."""
    shapes, found = shapes.copy(), []
    size = np.sum(shapes**2 / np.nanmean(shapes**2, axis=0), axis=1)
    for _ in range(int(MOST * len(dofs)) + 1):
        groups = foretold(dofs, shapes, geometry)
        clearest = [_clearest(group, size > LEAST_MOTION**2 * np.nanmean(size)) for group in groups]
        known = [row for row in clearest if row is not None and row not in found]
        if not known:
            return tuple(found)
        found += known
        shapes[known] *= -1
    return ()


def _clearest(group: Foretold, moves: np.ndarray) -> int | None:
    """The row (index) that is clearly turned, None where none is or another might be instead."""
    gain = group.gain
    k = int(np.argmax(gain))
    stated, turned = group.turning()
    if turned[k] > TURNED or stated[k] < STATED or not moves[group.index[k]]:
        return None
    values = group.values.copy()
    values[k] *= -1
    after = Foretold(group.index, values, group.precision).gain
    # Another row might be turned instead if little is left for it once this one is turned.
    rival = (gain > RIVAL * gain[k]) & (after < gain / 2)
    return int(group.index[k]) if np.count_nonzero(rival) <= 1 else None


def exchanged_nodes(
    dofs: Sequence[Dof], shapes: np.ndarray, geometry: Geometry
) -> tuple[str, str] | None:
    """Two nodes whose rows fit each other's places, None where no two clearly do."""
    groups = foretold(dofs, shapes, geometry)
    nodes = list(dict.fromkeys(dofs[k].node for group in groups for k in group.index))
    if len(nodes) < LEAST_ROWS:
        return None
    rows = np.full((len(nodes), len(groups)), -1)
    surprise = np.zeros(len(nodes))
    for g, group in enumerate(groups):
        each = np.sum(group.surprise, axis=1)
        for k, total in zip(range(group.index.size), each, strict=True):
            n = nodes.index(dofs[group.index[k]].node)
            rows[n, g] = k
            surprise[n] += total
    usual = float(np.median(surprise))
    alike = [tuple(row < 0) for row in rows]  # measured in the same directions
    pairs = [p for p in combinations(range(len(nodes)), 2) if alike[p[0]] == alike[p[1]]]
    gain = np.array([_gain(groups, rows[list(pair)]) for pair in pairs])
    for best in np.argsort(-gain)[:LIKELIEST]:
        a, b = pairs[best]
        before = surprise[a] + surprise[b]
        rivals = [g for g, p in zip(gain, pairs, strict=True) if len({a, b} & set(p)) == 1]
        sure = before > 2 * SURPRISED * usual and max(rivals, default=0.0) < RIVAL * gain[best]
        if sure and _left(groups, rows[[a, b]]) < EXPLAINED * before:
            return nodes[a], nodes[b]
    return None


def _exchange(group: Foretold, rows: np.ndarray) -> Foretold:
    values = group.values.copy()
    values[rows] = values[rows[::-1]]
    return Foretold(group.index, values, group.precision)


def _left(groups: tuple[Foretold, ...], rows: np.ndarray) -> float:
    """Surprise at two nodes, their rows (2, groups) exchanged."""
    total = 0.0
    for g, group in enumerate(groups):
        if rows[0, g] >= 0:
            total += float(np.sum(_exchange(group, rows[:, g]).surprise[rows[:, g]]))
    return total


def _gain(groups: tuple[Foretold, ...], rows: np.ndarray) -> float:
    """Fall of −2 log likelihood where the rows (2, groups) of two nodes are exchanged."""
    gain = 0.0
    for group, (a, b) in zip(groups, rows.T, strict=True):
        if a >= 0:
            p, apart = group.precision, group.values[b] - group.values[a]
            slope = p[a] @ group.values - p[b] @ group.values
            curve = p[a, a] + p[b, b] - 2 * p[a, b]
            gain -= float(np.sum(2 * apart * slope + curve * apart**2))
    return gain
