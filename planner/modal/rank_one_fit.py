"""One shape from the residues of one mode, whichever entries of the matrix were measured.

A mode's residues are R = φ_o φ_i / (2iω_d) for shapes φ of unit modal mass (Maxwell's
reciprocity). Points that were both hit and felt tie the two sides together: an entry on the
diagonal (a driving point), or any odd ring of entries, fixes the scale.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from planner.inference.student import widening_factor
from planner.modal.least_squares import scaled_inverse

ROUNDS = 60  # of alternating and of Gauss-Newton steps
ROUGH, STILL = 1e-3, 1e-6  # a step below, relative to the shape, is the last: while weights change
# Relative to all entries, an error that each is given at first: none rules alone.
START_SHARE = 0.03
REWEIGHED, SPREAD_ROUNDS = 4, 30  # times that weights follow what no shape explains; its steps
SETTLED = 0.03  # relative change of the variance, below which it is settled


@dataclass(frozen=True, eq=False)
class Entries:
    """Which entries were measured: row and column of each as indices of points.

    `rows` and `columns` (e,) index `points` points. Where reciprocity is not to be used, the
    points that were hit are others than those that felt it.
    """

    rows: np.ndarray
    columns: np.ndarray
    points: int

    @property
    def groups(self) -> tuple[np.ndarray, np.ndarray]:
        """Group (points,) of each point, and (groups,) whether the group's scale is known.

        Groups share no entry. A group's scale is known where its entries cannot be parted into
        rows and columns that never meet: where the graph of its entries holds an odd ring.
        """
        from scipy.sparse.csgraph import connected_components  # 0.2 s

        # Of two copies of each point, entries join one of a row with the other of a column: where
        # an odd ring is, both copies are in one part.
        n = self.points
        joined = np.zeros((2 * n, 2 * n), bool)
        joined[self.rows, n + self.columns] = joined[n + self.rows, self.columns] = True
        part = connected_components(joined, directed=False)[1].reshape(2, n)
        first, group = np.unique(np.min(part, axis=0), return_index=True, return_inverse=True)[1:]
        return group, part[0, first] == part[1, first]


@dataclass(frozen=True, eq=False)
class FittedShape:
    """A shape over all points, with what is left of the residues.

    `sd` (points,) is of real and imaginary part each. `gains` (t,) are the relative errors of the
    rows of the points `tied` (t,) that are rows and columns, with `gain_covariance` (t, t).
    """

    shape: np.ndarray  # (points,) complex
    sd: np.ndarray
    tied: np.ndarray
    gains: np.ndarray
    gain_covariance: np.ndarray


def fit_shape(
    entries: Entries,
    residue: np.ndarray,
    variance: np.ndarray,
    damped_1_s: float,
    gain: float = 0.0,
    near: np.ndarray | None = None,
) -> FittedShape:
    """Shape φ with residue ≈ φ_row φ_column / (2iω_d).

    residue (e,) in m/(N·s), variance (e,) of real and imaginary part each; damped_1_s: ω_d;
    `gain`: relative sd by which whole rows err, which only rows of points that are columns too can
    show; `near` (points,): a shape to start from. The shape has unit modal mass (kg^−½) in groups
    whose scale is known; in others rows and columns share the residue evenly. What no shape
    explains widens the variance: that of each column by a factor, that of all entries in
    proportion to their size.
    """
    values = residue * 2j * damped_1_s
    noise = 2 * variance * (2 * damped_1_s) ** 2
    even = noise + START_SHARE**2 * np.mean(np.abs(values) ** 2)
    tied = np.intersect1d(entries.rows, entries.columns) if gain else np.zeros(0, int)
    problem = _RankOneProblem(entries, values, tied, max(gain, 1e-12))
    near = _start(entries, values, 1 / even) if near is None else near
    found = np.append(near, np.zeros(tied.size))
    spread, proportional = even, np.zeros(even.size)
    for _ in range(REWEIGHED):
        found = _fitted(problem, 1 / spread, found, ROUGH)
        left, jacobian = problem.left(found), problem.jacobian(found)
        covariance = problem.covariance(jacobian, 1 / spread)
        taken = np.sum((jacobian.conj() @ covariance) * jacobian, axis=1).real / spread
        free = residue.size - float(np.sum(taken))
        # Least free: degrees of freedom, with fewer of which nothing is left over to tell
        if free < 1.0:
            spread, proportional = noise, np.zeros(noise.size)
            break
        square = np.abs(left) ** 2 * residue.size / free
        size = np.abs(values - left) ** 2
        before = spread
        constant, proportional = _spread(entries.columns, square, noise, size)
        spread = constant + proportional
        if np.all(np.abs(spread / before - 1) < SETTLED):
            break
    found = _fitted(problem, 1 / spread, found)
    jacobian = problem.jacobian(found)
    # What errs in proportion errs in phase: all of it is in the real part, not half.
    covariance = problem.covariance(jacobian, 1 / (spread + proportional))
    n = entries.points
    sd = np.sqrt(np.maximum(np.diag(covariance)[:n].real, 0.0) / 2)
    alone = np.setdiff1d(entries.rows, tied)
    sd[alone] = np.hypot(sd[alone], gain * np.abs(found[alone]))
    return FittedShape(found[:n], sd, tied, found[n:], covariance[n:, n:].real / 2)


def _spread(
    columns: np.ndarray, square: np.ndarray, noise: np.ndarray, size: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(e,) variances κ_column · noise and share · size, most likely for squared errors (e,).

    κ ≥ 1 and share ≥ 0 by multiplicative steps, as for the factors of spectra (Févotte, Bertin
    and Durrieu 2009).
    """
    parts = [noise * (columns == c) for c in np.unique(columns)] + [size]
    table = np.stack(parts)
    factor = np.ones(len(parts))
    factor[-1] = START_SHARE**2
    for _ in range(SPREAD_ROUNDS):
        total = factor @ table
        step = (table @ (square / total**2)) / np.maximum(table @ (1 / total), 1e-300)
        factor *= np.sqrt(step)
        factor[:-1] = np.maximum(factor[:-1], 1.0)
    return factor[:-1] @ table[:-1], factor[-1] * table[-1]


@dataclass(frozen=True, eq=False)
class _RankOneProblem:
    """φ_row φ_column (1 + g_row) beside values (e,); unknowns: all φ, g of the `tied` points."""

    entries: Entries
    values: np.ndarray
    tied: np.ndarray
    gain: float

    def factor(self, found: np.ndarray) -> np.ndarray:
        """(e,) 1 + g of each entry's row."""
        gains = np.zeros(self.entries.points, complex)
        gains[self.tied] = found[self.entries.points :]
        return 1 + gains[self.entries.rows]

    def left(self, found: np.ndarray) -> np.ndarray:
        """(e,) what is not explained."""
        e = self.entries
        return self.values - found[e.rows] * found[e.columns] * self.factor(found)

    def jacobian(self, found: np.ndarray) -> np.ndarray:
        """(e, unknowns) change of the model with the unknowns."""
        e, factor = self.entries, self.factor(found)
        jacobian = np.zeros((e.rows.size, found.size), complex)
        index = np.arange(e.rows.size)
        np.add.at(jacobian, (index, e.rows), found[e.columns] * factor)
        np.add.at(jacobian, (index, e.columns), found[e.rows] * factor)
        place = np.full(e.points, -1)
        place[self.tied] = e.points + np.arange(self.tied.size)
        there = index[place[e.rows] >= 0]
        jacobian[there, place[e.rows[there]]] = (found[e.rows] * found[e.columns])[there]
        return jacobian

    def normal(self, jacobian: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """(unknowns, unknowns) with the prior of the gains."""
        normal = jacobian.conj().T @ (weight[:, None] * jacobian)
        known = np.arange(self.entries.points, len(normal))
        # Real and imaginary part each err by the gain.
        normal[known, known] += 1 / (2 * self.gain**2)
        return normal

    def covariance(self, jacobian: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """(unknowns, unknowns); directions that nothing determines count as known."""
        return scaled_inverse(self.normal(jacobian, weight), 1e-12)

    def error(self, found: np.ndarray, weight: np.ndarray) -> float:
        """χ² of the values and of the gains."""
        gains = np.abs(found[self.entries.points :]) ** 2
        left = np.abs(self.left(found)) ** 2
        return float(np.sum(weight * left) + np.sum(gains) / (2 * self.gain**2))


def _fitted(
    problem: _RankOneProblem, weight: np.ndarray, found: np.ndarray, still: float = STILL
) -> np.ndarray:
    """The unknowns that fit best, from first ones (Gauss-Newton)."""
    n = problem.entries.points
    for _ in range(ROUNDS):
        jacobian = problem.jacobian(found)
        normal = problem.normal(jacobian, weight)
        slope = jacobian.conj().T @ (weight * problem.left(found))
        slope[n:] -= found[n:] / (2 * problem.gain**2)
        # A ridge far below all that is determined: a scale that is free then stays where it is.
        normal[np.arange(n), np.arange(n)] += 1e-11 * np.trace(normal[:n, :n]).real / n
        step = np.linalg.solve(normal, slope)
        # The longest part of the step that does not make the fit worse
        most = problem.error(found, weight) * (1 + 1e-12)
        tried = (found + part * step for part in (1.0, 0.5, 0.2, 0.05))
        found = next((one for one in tried if problem.error(one, weight) <= most), found)
        if np.linalg.norm(step) < still * np.linalg.norm(found):
            break
    return found


def _start(entries: Entries, values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """A first shape: rows and columns apart (alternating), then both brought to one scale."""
    n = entries.points
    table, w = np.zeros((n, n), complex), np.zeros((n, n))
    np.add.at(table, (entries.rows, entries.columns), weight * values)
    np.add.at(w, (entries.rows, entries.columns), weight)
    filled = np.divide(table, w, out=np.zeros_like(table), where=w > 0)
    right = np.linalg.svd(filled, full_matrices=False)[2][0]
    left = np.zeros(n, complex)
    for _ in range(ROUNDS):
        before = left
        left = _ratio(table @ right.conj(), w @ np.abs(right) ** 2)
        right = _ratio(table.T @ left.conj(), w.T @ np.abs(left) ** 2)
        if np.linalg.norm(left - before) < 1e-6 * np.linalg.norm(left):
            break
    both = (left != 0) & (right != 0)
    # left·a and right/a are the same shape where both are known.
    ratio = np.sum(right[both] * left[both].conj()) / max(np.sum(np.abs(left[both]) ** 2), 1e-300)
    if ratio == 0:
        ratio = np.linalg.norm(right) / max(np.linalg.norm(left), 1e-300)
    root = np.sqrt(complex(ratio))
    felt = np.zeros(n, bool)
    felt[entries.rows] = True
    return np.where(felt, left * root, right / root)


def _ratio(top: np.ndarray, bottom: np.ndarray) -> np.ndarray:
    return np.divide(top, bottom, out=np.zeros_like(top), where=bottom > 0)


FREE_GAIN = 0.2  # sd that leaves a row's gain to what is measured


def row_gain(shapes: Sequence[FittedShape]) -> float:
    """Relative sd of rows' gains for intervals of 95 %, from shapes fitted with gains left free."""
    tied = shapes[0].tied.size
    common = own = count = 0.0
    for i, j in combinations(range(tied), 2):
        found = _difference(shapes, i, j)
        if found is not None:
            common, own, count = common + found[0], own + found[1], count + 1
    if not count:
        return 0.0
    # Of one degree of freedom Student's t would call every shape unknown: it counts as two.
    return float(np.sqrt(widening_factor(max(tied - 1, 2)) ** 2 * common / count + own / count))


def _difference(shapes: Sequence[FittedShape], i: int, j: int) -> tuple[float, float] | None:
    """Variance of a gain: what all modes have in common, and what is each mode's own."""
    apart = np.array([np.real(s.gains[i] - s.gains[j]) for s in shapes])
    variance = [
        s.gain_covariance[i, i] + s.gain_covariance[j, j] - 2 * s.gain_covariance[i, j]
        for s in shapes
    ]
    prior = 1 / (2 * FREE_GAIN**2)
    known = 1 / np.maximum(variance, 1e-300) - prior
    kept = known > prior
    if not kept.any():
        return None
    # The prior draws a difference towards zero; what was measured does not.
    apart = apart[kept] * (known[kept] + prior) / known[kept]
    # Least sd of a gain in one mode: residues agree no better than this
    noise = 1 / known[kept] + 0.002**2
    weight = 1 / noise
    mean, total = np.sum(weight * apart) / np.sum(weight), np.sum(weight)
    beyond = np.sum(weight * (apart - mean) ** 2) - (kept.sum() - 1)
    scale = total - np.sum(weight**2) / total
    own = max(0.0, beyond / scale) if kept.sum() > 1 and scale > 0 else 0.0
    weight = 1 / (noise + own)
    mean = np.sum(weight * apart) / np.sum(weight)
    return max(0.0, mean**2 - 1 / np.sum(weight)) / 2, own / 2
