"""Poles and one shape per mode, fitted to all FRFs between some points at once, and how sure.

A mode's residues are R = −i φ_o φ_i (Maxwell's reciprocity; the factor 1/(2ω_d) is part of φ): n
numbers instead of n², real ones where damping is proportional. What the fit does not tell from
nothing (phases, modes outside the lines) is taken away and the rest fitted again (Wald). That is
surer by far where FRFs are small: beside a resonance, between two, in differences of them.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import chi2

from planner.modal.fit_data import Data
from planner.modal.least_squares import scaled_inverse, slope_turn
from planner.modal.pole_fit import PoleFit
from planner.modal.rank_one_fit import Entries, fit_shape
from planner.modal.residues import basis, basis_slope, complex_of

SURELY = 1 - 1e-6  # that χ² rises by less where all of it is nothing: else nothing is taken away
STEPS, HALVED = 20, 6  # of Gauss and Newton, and how often one is shortened


@dataclass(frozen=True, eq=False)
class ShapeFit:
    """Poles (m,) in rad/s and coefficients (e, c) as `residues.basis` has them, and their errors.

    `root` (2m + e·c, d) are d independent errors, of one standard deviation each, of the poles'
    real parts, their imaginary parts, then entry by entry the coefficients. `shaped` are the modes
    (indices) whose residues are of one shape, `chi2` is per degree of freedom.
    """

    data: Data
    poles: np.ndarray
    coefficients: np.ndarray
    root: np.ndarray
    shaped: np.ndarray
    chi2: float

    @property
    def response(self) -> np.ndarray:
        """(e, F) of the fit."""
        return self.coefficients @ basis(self.data.lines, self.poles)

    @property
    def errors(self) -> np.ndarray:
        """(d, e, F) independent errors of the response, of one standard deviation each."""
        m, lines = self.poles.size, self.data.lines
        columns, slope = basis(lines, self.poles), basis_slope(lines, self.poles)
        own = self.root[2 * m :].reshape(*self.coefficients.shape, -1)
        by_poles = slope_turn(self.coefficients, m).transpose(0, 2, 1) @ slope
        errors = self.root[: 2 * m].T @ by_poles + own.transpose(0, 2, 1) @ columns
        return errors.transpose(1, 0, 2)

    def drawn(self, count: int, seed: int) -> list[tuple[np.ndarray, np.ndarray]]:
        """So many poles and coefficients that are as likely as each other."""
        m, found = self.poles.size, []
        at = np.concatenate([self.poles.real, self.poles.imag])
        for normal in np.random.default_rng(seed).standard_normal((count, self.root.shape[1])):
            by = self.root @ normal
            # Neither decay nor frequency is ever below zero, however unsure.
            poles = complex_of(at * np.exp(np.clip(by[: 2 * m] / at, -1.0, 1.0)))
            found.append((poles, self.coefficients + by[2 * m :].reshape(self.coefficients.shape)))
        return found


def shape_fit(
    data: Data, fit: PoleFit, entries: Entries, scale: np.ndarray | None = None
) -> ShapeFit:
    """From a fit whose residues were free, of responses in the order of the `entries` (e,).

    Poles outside the lines, and those nearer to each other than their damping, keep free residues:
    they may stand for several modes. So do all where the FRFs speak against reciprocity (a spindle
    that turns). Variances grow by `scale` (m,), mode by mode.
    """
    freedom = 2 * data.entries * data.frequency_hz.size

    def surely_worse(before: float, after: float, fewer: int) -> bool:
        most = float(chi2.ppf(SURELY, max(1, fewer)))
        return after - before > most * max(1.0, before / freedom)

    problem = _ShapeProblem(data, fit, entries, True)
    point = problem.settled(problem.start(fit), np.ones(problem.size, bool))
    unshaped = _ShapeProblem(data, fit, entries, False)
    if surely_worse(float(np.sum(fit.chi2)), point.chi2, unshaped.size - problem.size):
        problem, point = unshaped, unshaped.start(fit)
    every = np.ones(problem.size, bool)
    plain, kept = problem.without_nothings(point)
    plain = problem.settled(plain, kept)
    if not surely_worse(point.chi2, plain.chi2, int(np.count_nonzero(~kept))):
        point, every = plain, kept
    root = problem.tangent(point.values)[:, every] @ point.root(every)
    whole = problem.coefficients(point.values)
    if scale is not None:
        rest = np.full(whole.shape[1] - 2 * scale.size, np.max(scale))
        grown = [np.tile(scale, 2), *[np.append(np.tile(scale, 2), rest)] * len(whole)]
        root = np.sqrt(np.concatenate(grown))[:, None] * root
    per_freedom = point.chi2 / max(freedom - root.shape[1], 1)
    return ShapeFit(data, problem.poles(point.values), whole, root, problem.shaped, per_freedom)


@dataclass(frozen=True, eq=False)
class _ShapePoint:
    """χ² at values (u,), its slope (−½ of it, (u,)) and half its curvature (u, u)."""

    values: np.ndarray
    chi2: float
    slope: np.ndarray
    normal: np.ndarray

    def root(self, kept: np.ndarray) -> np.ndarray:
        """(k, k) root of the covariance of the values that are kept (u,) bool, of no sign."""
        normal = self.normal[np.ix_(kept, kept)]
        unit = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        values, vectors = np.linalg.eigh(normal / unit[:, None] / unit)
        # Rounding: share of the curvature
        some = values > 1e-13 * values[-1]
        own = vectors[:, some]
        return own / np.sqrt(values[some]) @ own.T / unit[:, None]


class _ShapeProblem:
    """Weights 2/variance (e, F) of the responses; `shaped` are the modes that have one shape each.

    Values: Re and Im of the poles, Re φ and Im φ mode by mode, then entry by entry the coefficients
    that are `left` free: residues of other modes, out-of-band terms.
    """

    def __init__(self, data: Data, fit: PoleFit, entries: Entries, reciprocal: bool) -> None:
        poles, self.data, self.entries, self.weight = fit.poles, data, entries, 2 / fit.variance
        apart = np.abs(poles[:, None] - poles) + np.diag(np.full(poles.size, np.inf))
        wide = np.maximum(np.abs(poles.real)[:, None], np.abs(poles.real))
        alone = np.all(apart > wide / 2, axis=1)
        alone &= np.abs(poles) < 2 * np.pi * data.frequency_hz[-1]
        alone &= data.entries > entries.points  # or nothing would tie the points
        self.modes, self.shaped = poles.size, np.flatnonzero(alone & reciprocal)

    @cached_property
    def left(self) -> np.ndarray:
        """Columns of the coefficients that are free."""
        columns = np.arange(2 * (self.modes + len(self.data.lines.rest)))
        return np.setdiff1d(columns, np.r_[self.shaped, self.modes + self.shaped])

    @property
    def end(self) -> int:
        """Number of poles' and shapes' values."""
        return 2 * (self.modes + self.shaped.size * self.entries.points)

    @property
    def size(self) -> int:
        """Number of all values."""
        return self.end + self.left.size * len(self.weight)

    def poles(self, values: np.ndarray) -> np.ndarray:
        """(m,) in rad/s."""
        return complex_of(values[: 2 * self.modes])

    def _shapes(self, values: np.ndarray) -> np.ndarray:
        """(k, n) of the modes that have one."""
        parts = values[2 * self.modes : self.end].reshape(self.shaped.size, 2, self.entries.points)
        return parts[:, 0] + 1j * parts[:, 1]

    def coefficients(self, values: np.ndarray) -> np.ndarray:
        """(e, c) of all modes."""
        shape, e, m = self._shapes(values), self.entries, self.modes
        out = np.zeros((len(self.weight), self.left.size + 2 * self.shaped.size))
        out[:, self.left] = values[self.end :].reshape(len(out), -1)
        residue = -1j * (shape[:, e.rows] * shape[:, e.columns]).T
        out[:, self.shaped], out[:, m + self.shaped] = residue.real, residue.imag
        return out

    def start(self, fit: PoleFit) -> _ShapePoint:
        """Shapes that explain the free residues best."""
        residue, variance = fit.residue, fit.residue_variance
        shape = np.array(
            [fit_shape(self.entries, residue[:, k], variance[:, k], 0.5).shape for k in self.shaped]
        ).reshape(self.shaped.size, 1, self.entries.points)
        parts = np.concatenate([shape.real, shape.imag], axis=1)
        free = fit.coefficients[:, self.left]
        both = fit.poles.real, fit.poles.imag
        return self.at(np.concatenate([*both, parts.ravel(), free.ravel()]))

    def at(self, values: np.ndarray) -> _ShapePoint:
        """χ² and how it goes on."""
        m, lines, poles = self.modes, self.data.lines, self.poles(values)
        columns, slope = basis(lines, poles), basis_slope(lines, poles)
        own, each = self.coefficients(values), len(columns)
        size = 2 * m + own.size
        normal, gradient, square = np.zeros((size, size)), np.zeros(size), 0.0
        for e, (c, w) in enumerate(zip(own, self.weight, strict=True)):
            part = np.concatenate([slope_turn(c, m).T @ slope, columns])
            off = self.data.values[e] - c @ columns
            index = np.r_[: 2 * m, 2 * m + e * each : 2 * m + (e + 1) * each]
            weighted = part.conj() * w
            normal[np.ix_(index, index)] += (weighted @ part.T).real
            gradient[index] += (weighted @ off).real
            square += float(w @ np.abs(off) ** 2)
        tangent = self.tangent(values)
        return _ShapePoint(values, square, tangent.T @ gradient, tangent.T @ normal @ tangent)

    def tangent(self, values: np.ndarray) -> np.ndarray:
        """(2m + e·c, u) change of poles and all coefficients with the values."""
        m, e, count = self.modes, self.entries, len(self.weight)
        index, each = np.arange(count), self.left.size + 2 * self.shaped.size
        out = np.zeros((2 * m + count * each, self.size))
        out[: 2 * m, : 2 * m] = np.eye(2 * m)
        change = np.zeros((count, each, self.shaped.size, 2, e.points))
        for k, (mode, shape) in enumerate(zip(self.shaped, self._shapes(values), strict=True)):
            by = np.zeros((count, e.points), complex)
            np.add.at(by, (index, e.rows), -1j * shape[e.columns])
            np.add.at(by, (index, e.columns), -1j * shape[e.rows])
            both = np.stack([by, 1j * by], axis=1)
            change[:, mode, k], change[:, m + mode, k] = both.real, both.imag
        out[2 * m :, 2 * m : self.end] = change.reshape(count * each, self.end - 2 * m)
        rows = 2 * m + each * index[:, None] + self.left
        out[rows.ravel(), self.end + np.arange(rows.size)] = 1.0
        return out

    def settled(self, point: _ShapePoint, kept: np.ndarray) -> _ShapePoint:
        """Where χ² is least, the values that are not kept (u,) bool held where they are."""
        for _ in range(STEPS):
            root, step = point.root(kept), np.zeros(self.size)
            step[kept] = root @ (root.T @ point.slope[kept])
            tried = (point.values + step / 2**k for k in range(HALVED))
            allowed = (self.at(v) for v in tried if self.data.allowed(self.poles(v)))
            there = next((one for one in allowed if one.chi2 <= point.chi2), point)
            fall, point = point.chi2 - there.chi2, there
            # Settled: fall of χ² in a step that is the last
            if fall < 1e-2:
                break
        return point

    def without_nothings(self, point: _ShapePoint) -> tuple[_ShapePoint, np.ndarray]:
        """The point where what is nothing as far as the fit tells is zero, and what is not (u,)."""
        kept, values = np.ones(self.size, bool), point.values.copy()
        root = point.root(kept)
        covariance = root @ root.T
        # What earlier groups leave no freedom has a variance of rounding alone.
        least = np.maximum(1e-13 * np.diag(covariance), 1e-300)
        for group in self._nothings():
            inverse = scaled_inverse(covariance[np.ix_(group, group)], 1e-10, least[group])
            # Chance of what is nothing not to be called something
            if values[group] @ inverse @ values[group] > chi2.ppf(0.999, group.size):
                continue
            gain = covariance[:, group] @ inverse
            values = values - gain @ values[group]
            covariance = covariance - gain @ covariance[group]
            kept[group], values[group] = False, 0.0
        poles = slice(0, 2 * self.modes)  # they stay for once, if the step is too far
        if not self.data.allowed(self.poles(values)):
            values[poles] = point.values[poles]
        return self.at(values), kept

    def _nothings(self) -> list[np.ndarray]:
        """Values (indices) that may be nothing, one group after the other.

        Out-of-band terms, each and all of their phases; then mode by mode the phases.
        """
        own = self.end + np.arange(self.size - self.end).reshape(len(self.weight), -1)
        terms = len(self.data.lines.rest)
        real, imag = own[:, -2 * terms : -terms], own[:, -terms:]
        found = [np.r_[real[:, k], imag[:, k]] for k in range(terms)]
        found.append(imag.ravel())
        points = self.entries.points
        for k in range(self.shaped.size):
            found.append(2 * self.modes + points * (2 * k + 1) + np.arange(points))
        other = (self.left.size - 2 * terms) // 2
        return [*found, *(own[:, k] for k in range(other))]
