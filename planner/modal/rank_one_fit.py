"""One shape from the residues of one mode, whichever entries of the matrix were measured.

A mode's residues are R = φ_o φ_i / (2iω_d) for shapes φ of unit modal mass (Maxwell's
reciprocity). Points that were both hit and felt tie the two sides together: an entry on the
diagonal (a driving point), or any odd ring of entries, fixes the scale.
"""

from dataclasses import dataclass

import numpy as np

ROUNDS, STILL = 60, 1e-8  # of alternating and of Gauss-Newton steps, relative to the shape
RIDGE = 1e-11
# Relative to all entries, an error that each is given at first: none rules alone.
START_SHARE = 0.03
REWEIGHED = 3  # times that the weights follow what no shape explains


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
        side = np.zeros(self.points, int)
        group, odd = np.full(self.points, -1), []
        neighbours: list[list[int]] = [[] for _ in range(self.points)]
        for a, b in zip(self.rows, self.columns, strict=True):
            neighbours[a].append(int(b))
            neighbours[b].append(int(a))
        for start in range(self.points):
            if group[start] >= 0:
                continue
            number, stack = len(odd), [start]
            group[start], side[start] = number, 1
            odd.append(False)
            while stack:
                a = stack.pop()
                for b in neighbours[a]:
                    if group[b] < 0:
                        group[b], side[b] = number, -side[a]
                        stack.append(b)
                    elif side[b] == side[a]:
                        odd[number] = True
        return group, np.array(odd)


@dataclass(frozen=True, eq=False)
class FittedShape:
    """A shape over all points, with what is left of the residues.

    `sd` (points,) is of real and imaginary part each; `misfit` is χ² per degree of freedom of
    the noise alone; NaN where no entry is left over to tell. Beyond it entries count as uncertain
    in proportion to their size, as hits and sets make them.
    """

    shape: np.ndarray  # (points,) complex
    sd: np.ndarray
    misfit: float
    left: np.ndarray  # (e,) residues less what the shape explains, complex


def fit_shape(
    entries: Entries, residue: np.ndarray, variance: np.ndarray, damped_1_s: float
) -> FittedShape:
    """Shape φ with residue ≈ φ_row φ_column / (2iω_d).

    residue (e,) in m/(N·s), variance (e,) of real and imaginary part each; damped_1_s: ω_d. The
    shape has unit modal mass (kg^−½) in groups whose scale is known; in others rows and columns
    share the residue evenly.
    """
    values = residue * 2j * damped_1_s
    noise = 2 * variance * (2 * damped_1_s) ** 2
    even = noise + START_SHARE**2 * np.mean(np.abs(values) ** 2)
    shape = _fitted(entries, values, 1 / even, _start(entries, values, 1 / even))
    weight = 1 / noise
    for _ in range(REWEIGHED):
        shape = _fitted(entries, values, weight, shape)
        left = values - shape[entries.rows] * shape[entries.columns]
        jacobian = _jacobian(entries, shape)
        normal = jacobian.conj().T @ (weight[:, None] * jacobian)
        free = residue.size - int(np.linalg.matrix_rank(normal, tol=1e-12 * np.trace(normal).real))
        if free <= 0:
            break
        # What no shape explains is taken for hits and sets that differ in proportion.
        size = np.abs(shape[entries.rows] * shape[entries.columns]) ** 2
        beyond = np.sum((np.abs(left) ** 2 - noise) / noise)
        share = max(0.0, float(beyond / max(np.sum(size / noise), 1e-300)))
        weight = 1 / (noise + share * size)
    shape = _fitted(entries, values, weight, shape)
    left = values - shape[entries.rows] * shape[entries.columns]
    jacobian = _jacobian(entries, shape)
    normal = jacobian.conj().T @ (weight[:, None] * jacobian)
    covariance = np.linalg.pinv(normal, rcond=1e-12, hermitian=True)
    free = residue.size - int(np.linalg.matrix_rank(normal, tol=1e-12 * np.trace(normal).real))
    misfit = float(np.sum(np.abs(left) ** 2 / noise) / free) if free > 0 else float("nan")
    wider = max(1.0, float(np.sum(weight * np.abs(left) ** 2) / free)) if free > 0 else 1.0
    sd = np.sqrt(np.maximum(np.diag(covariance).real, 0.0) / 2 * wider)
    return FittedShape(shape, sd, misfit, left / (2j * damped_1_s))


def fit_halves(
    entries: Entries, residue: np.ndarray, variance: np.ndarray, damped_1_s: float
) -> FittedShape:
    """As `fit_shape`, rows and columns each by themselves; points that are both give the scale."""
    n = entries.points
    apart = Entries(entries.rows, entries.columns + n, 2 * n)
    found = fit_shape(apart, residue, variance, damped_1_s)
    rows, columns = found.shape[:n], found.shape[n:]
    felt, hit = np.isin(np.arange(n), entries.rows), np.isin(np.arange(n), entries.columns)
    both = felt & hit
    if not both.any():
        return fit_shape(entries, residue, variance, damped_1_s)
    ratio = np.vdot(rows[both], columns[both]) / max(np.linalg.norm(rows[both]) ** 2, 1e-300)
    root = np.sqrt(complex(ratio)) or 1.0
    shape = np.where(felt, rows * root, columns / root)
    sd = np.where(felt, found.sd[:n] * abs(root), found.sd[n:] / abs(root))
    return FittedShape(shape, sd, found.misfit, found.left)


def _fitted(
    entries: Entries, values: np.ndarray, weight: np.ndarray, shape: np.ndarray
) -> np.ndarray:
    """The shape that fits best, from a first one (Gauss-Newton)."""
    for _ in range(ROUNDS):
        jacobian = _jacobian(entries, shape)
        normal = jacobian.conj().T @ (weight[:, None] * jacobian)
        left = values - shape[entries.rows] * shape[entries.columns]
        # A ridge far below all that is determined: a scale that is free then stays where it is.
        normal[np.diag_indices(entries.points)] += RIDGE * np.trace(normal).real / entries.points
        step = np.linalg.solve(normal, jacobian.conj().T @ (weight * left))
        shape = _shortened(entries, values, weight, shape, step)
        if np.linalg.norm(step) < STILL * np.linalg.norm(shape):
            break
    return shape


def _jacobian(entries: Entries, shape: np.ndarray) -> np.ndarray:
    """(e, points) change of φ_row φ_column with the shape."""
    jacobian = np.zeros((entries.rows.size, entries.points), complex)
    index = np.arange(entries.rows.size)
    np.add.at(jacobian, (index, entries.rows), shape[entries.columns])
    np.add.at(jacobian, (index, entries.columns), shape[entries.rows])
    return jacobian


def _shortened(
    entries: Entries, values: np.ndarray, weight: np.ndarray, shape: np.ndarray, step: np.ndarray
) -> np.ndarray:
    """The shape after the longest part of a step that does not make the fit worse."""

    def error(at: np.ndarray) -> float:
        return float(np.sum(weight * np.abs(values - at[entries.rows] * at[entries.columns]) ** 2))

    now = error(shape)
    for part in (1.0, 0.5, 0.2, 0.05):
        if error(shape + part * step) <= now * (1 + 1e-12):
            return shape + part * step
    return shape


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
