"""How points move like their neighbours: Gaussian fields over a structure's geometry.

Between neighbours a structure moves smoothly: Matérn fields over the places, each direction by
itself, and, where trace lines join the points, slender beams of one cross-section along the lines:
their flexibility is the covariance, so that a motion is the likelier the less it bends them, and
points on a straight line move alike along it.

How a point should move in all modes is predicted from the others, each left out in turn: a row that
is the opposite of that was measured with a turned sign.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.recording.points import DIRECTIONS, Dof
from planner.recording.uff import Geometry

# Correlation lengths in spacings of the points, and likewise how far a beam carries on a bed that
# holds its points and lets them turn.
LENGTHS = (1.0, 1.5, 2.2, 3.3, 5.0, 8.0)
CARRIES = (2.0, 4.0, 8.0, 16.0)
NUGGET = 0.03  # of the motion: rows err by this


def motion_fields(dofs: Sequence[Dof], geometry: Geometry) -> list[np.ndarray]:
    """Covariances (n, n) of motions at degrees of freedom of known place, one on average."""
    place = np.array([geometry.at(dof.node) for dof in dofs])
    direction = np.array([DIRECTIONS.index(dof.positive.direction) for dof in dofs])
    nodes = np.array(list({dof.node: place[k] for k, dof in enumerate(dofs)}.values()))
    between = np.linalg.norm(nodes[:, None] - nodes, axis=-1)
    np.fill_diagonal(between, np.inf)
    spacing = float(np.median(np.min(between, axis=1)))
    same = direction[:, None] == direction
    apart = np.linalg.norm(place[:, None] - place, axis=-1)
    fields = []
    for length in LENGTHS:
        scaled = np.sqrt(5) * apart / (length * spacing)
        fields.append(same * (1 + scaled + scaled**2 / 3) * np.exp(-scaled))
    ends = {node for line in geometry.lines for node in line}
    if ends.issuperset(dof.node for dof in dofs) and np.all(direction > 0):
        fields += _of_beams(dofs, direction, geometry)
    return [field / np.mean(np.diag(field)) for field in fields]


def _of_beams(dofs: Sequence[Dof], direction: np.ndarray, geometry: Geometry) -> list[np.ndarray]:
    """Flexibilities (n, n) of beams along the trace lines on beds of several stiffnesses."""
    every = list(dict.fromkeys(node for line in geometry.lines for node in line))
    index = {node: k for k, node in enumerate(every)}
    place = np.array([geometry.at(node) for node in every])
    along = np.array([place[index[b]] - place[index[a]] for a, b in geometry.lines])
    along /= np.median(np.linalg.norm(along, axis=1))
    stiffness = np.zeros((6 * len(every), 6 * len(every)))
    for (a, b), vector in zip(geometry.lines, along, strict=True):
        if np.any(vector):
            at = np.r_[6 * index[a] : 6 * index[a] + 6, 6 * index[b] : 6 * index[b] + 6]
            stiffness[np.ix_(at, at)] += _beam(vector)
    chosen = np.array([6 * index[dof.node] for dof in dofs]) + direction - 1
    moves = np.arange(len(stiffness)) % 6 < 3
    fields = []
    for reach in CARRIES:
        # Share of the bending stiffness: holds turns that no beam holds
        held = stiffness + np.diag(np.where(moves, 12 / reach**4, 1e-6))
        fields.append(np.linalg.inv(held)[np.ix_(chosen, chosen)])
    return fields


def _beam(vector: np.ndarray) -> np.ndarray:
    """(12, 12) stiffness of a slender beam (Euler and Bernoulli) between the ends of a vector."""
    length = float(np.linalg.norm(vector))
    axis = vector / length
    other = np.eye(3)[np.argmin(np.abs(axis))]
    side = np.cross(other, axis)
    side /= np.linalg.norm(side)
    turn = np.kron(np.eye(4), np.stack([axis, side, np.cross(axis, side)]))
    stiffness = np.zeros((12, 12))
    # Of a beam one spacing long, over its bending stiffness: along itself and in torsion. Tubes and
    # bars ten times as long as wide; torsion as of closed sections.
    for at, value in (((0, 6), 600.0 / length), ((3, 9), 0.8 / length)):
        stiffness[np.ix_(at, at)] += value * np.array([[1, -1], [-1, 1]])
    for at, sign in (((1, 5, 7, 11), 1), ((2, 4, 8, 10), -1)):
        b, c = 6 * length * sign, length**2
        bent = [[12, b, -12, b], [b, 4 * c, -b, 2 * c], [-12, -b, 12, -b], [b, 2 * c, -b, 4 * c]]
        stiffness[np.ix_(at, at)] += np.array(bent) / length**3
    return turn.T @ stiffness @ turn


LEAST_KNOWN = 8  # degrees of freedom, that foretell others


def expected(
    dofs: Sequence[Dof], shapes: np.ndarray, sds: np.ndarray, geometry: Geometry | None
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance (n, m) of complex motions of all points, each from the others.

    Shapes (n, m), sds (n, m) of real and imaginary part each. Without neighbours points move about
    as far as those of the well determined half, either way.
    """
    certain = np.abs(shapes) / np.maximum(sds, 1e-300)
    half = certain >= np.median(certain, axis=0)
    square = np.where(half, np.abs(shapes) ** 2, 0.0)
    power = np.sum(square, axis=0) / np.sum(half, axis=0)
    mean, variance = np.zeros(shapes.shape, complex), np.tile(power, (len(shapes), 1))
    if geometry is None:
        return mean, variance
    index = np.array([k for k, dof in enumerate(dofs) if geometry.at(dof.node) is not None], int)
    if index.size <= LEAST_KNOWN:
        return mean, variance
    fields = motion_fields([dofs[k] for k in index], geometry)
    for k in range(shapes.shape[1]):
        size = np.sqrt(power[k])
        motion, sd = shapes[index, k] / size, sds[index, k] / size
        found = _from_neighbours(fields, motion, sd)
        if found is not None:
            unknown = ~_known(motion, sd) & (found[1] < 1)
            mean[index[unknown], k] = found[0][unknown] * size
            variance[index[unknown], k] = found[1][unknown] * power[k]
    return mean, variance


def _from_neighbours(
    fields: Sequence[np.ndarray], motion: np.ndarray, sd: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Mean and variance (n,; ∞: nothing is known) of every point from the known others.

    By the likeliest field. Known points, each left out in turn, tell how far off that is: in
    proportion to how far the points around move, for a mode may move a part of the structure only.
    """
    known = _known(motion, sd)
    if np.count_nonzero(known) < LEAST_KNOWN:
        return None
    best, found = np.inf, None
    square = np.abs(motion[known]) ** 2
    for field in fields:
        noise = NUGGET**2 + 2 * sd[known] ** 2
        precision = np.linalg.inv(field[np.ix_(known, known)] + np.diag(noise))
        cross = field[:, known] @ precision
        mean, single = cross @ motion[known], 1 / np.diag(precision)
        variance = np.diag(field) - np.sum(cross * field[:, known], axis=1) + NUGGET**2
        off = precision @ motion[known] * single
        mean[known], variance[known] = motion[known] - off, single
        near = field[:, known] ** 2
        near[known, np.arange(single.size)] = 0.0
        weight, usual = np.sum(near, axis=1), np.full(len(near), np.mean(square))
        around = np.divide(near @ square, weight, out=usual.copy(), where=weight > 0)
        # Least around of the mean square, that points are taken to move by around any point
        variance *= around + 0.05 * usual
        scale = float(np.mean(np.abs(off) ** 2 / variance[known]))
        unlikely = np.sum(np.log(variance[known])) + single.size * np.log(max(scale, 1e-300))
        if unlikely < best:
            # Whom no known point is related to, nothing is predicted of.
            best, found = float(unlikely), (mean, np.where(weight > 0, scale * variance, np.inf))
    if found is not None:
        # What was measured, as far as it was, may say that this point is not like the others.
        found = found[0], np.maximum(found[1], np.abs(motion - found[0]) ** 2 - 2 * sd**2)
    return found


def _known(motion: np.ndarray, sd: np.ndarray) -> np.ndarray:
    """(n,) bool: points whose motion, relative to the mode's usual one, is well measured."""
    # Known: a point is known whose sd is less than this share of the mode's usual motion
    return sd < 0.1 * np.maximum(np.abs(motion), 1.0)


LEAST_ROWS, LEAST_MODES = 8, 3
# A row is turned where the squared difference to what is predicted is less than this, with the sign
# turned, and more than this as stated, relative to the row's own square, and where turning another
# row brings less than SECOND as much. Chosen on panels, frames and bolted pieces, none of whose
# right rows came near; the clearest was another row where that brought 0.86 as much, never below.
TURNED, STATED, SECOND = 0.35, 2.0, 0.8
MOST = 0.1  # share of rows that can be wrong: beyond, the geometry is


@dataclass(frozen=True, eq=False)
class RowPrediction:
    """Rows that have a place: `index` (n,) of them, values (n, m), precision (n, n) over rows."""

    index: np.ndarray
    values: np.ndarray
    precision: np.ndarray

    @cached_property
    def pull(self) -> np.ndarray:
        """(n, m) half the slope of −2 log likelihood by the values."""
        return self.precision @ self.values

    def fall(self, rows: np.ndarray, values: np.ndarray) -> np.ndarray:
        """(…) of −2 log likelihood, were rows (…, k) in truth the values (…, k, m)."""
        change = values - self.values[rows]
        curve = self.precision[rows[..., :, None], rows[..., None, :]] @ change
        return -np.sum(change * (2 * self.pull[rows] + curve), axis=(-2, -1))

    @property
    def gain(self) -> np.ndarray:
        """(n,) fall where a row is turned."""
        return self.fall(np.arange(len(self.values))[:, None], -self.values[:, None])


def predicted_rows(
    dofs: Sequence[Dof], shapes: np.ndarray, geometry: Geometry
) -> RowPrediction | None:
    """What the places predict of rows (n, m) real, NaN where unknown; None where they are few.

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
            best, found = likely, RowPrediction(index, values / np.sqrt(usual), precision)
    return found


def turned_rows(dofs: Sequence[Dof], shapes: np.ndarray, geometry: Geometry) -> tuple[int, ...]:
    """Rows (indices) whose sign is turned; the clearest is turned before the next is looked for."""
    shapes, turned = shapes.copy(), []
    size = np.sum(shapes**2 / np.nanmean(shapes**2, axis=0), axis=1)
    for _ in range(int(MOST * len(dofs)) + 1):
        found = predicted_rows(dofs, shapes, geometry)
        if found is None:
            return ()
        # Least motion of the mean over all rows: points that hardly move say nothing
        row = _clearest(found, size > 0.3**2 * np.nanmean(size))
        if row is None or row in turned:
            return tuple(turned)
        turned.append(row)
        shapes[row] *= -1
    return ()


def _clearest(found: RowPrediction, moves: np.ndarray) -> int | None:
    """The row (index) that is clearly turned, None where none is or another might be instead."""
    gain = found.gain
    k = int(np.argmax(gain))
    # Squared difference to what is predicted, relative to the row: as stated, and turned
    row, off = found.values[k], found.pull[k] / found.precision[k, k]
    power = max(float(row @ row), 1e-300)
    stated, turned = np.sum(off**2) / power, np.sum((2 * row - off) ** 2) / power
    if turned > TURNED or stated < STATED or not moves[found.index[k]]:
        return None
    values = found.values.copy()
    values[k] *= -1
    after = RowPrediction(found.index, values, found.precision).gain
    # Another row might be turned instead if little is left for it once this one is turned.
    rival = (gain > SECOND * gain[k]) & (after < gain / 2)
    return int(found.index[k]) if np.count_nonzero(rival) <= 1 else None
