"""Poles and one shape per mode, fitted to all FRFs between some points at once.

A mode's residues are R = φ_o φ_i (Maxwell's reciprocity; the factor 1/(2iω_d) is part of φ): n
numbers instead of n². That is surer by far where FRFs are small, and where differences of them
count. Poles, shapes and out-of-band terms err together: their joint covariance says how.
"""

from dataclasses import dataclass

import numpy as np

from planner.modal.fit_data import Data
from planner.modal.mode_selection import PoleFit
from planner.modal.rank_one_fit import Entries, fit_shape
from planner.modal.residues import Residues, basis, basis_slope, unpack

STEPS, HALVED = 20, 5  # Gauss-Newton steps, and how often one is shortened
SETTLED = 1e-2  # fall of χ² in a step that is the last
ROUNDING = 1e-11  # share of the curvature


@dataclass(frozen=True, eq=False)
class ShapeFit:
    """Poles (m,) in rad/s and coefficients (e, c) as `residues.basis` has them, and their errors.

    `root` (2m + e·c, d) are d independent errors, of one standard deviation each, of the poles'
    real parts, their imaginary parts, then entry by entry the coefficients. `chi2` is per degree of
    freedom.
    """

    data: Data
    poles: np.ndarray
    coefficients: np.ndarray
    root: np.ndarray
    chi2: float

    @property
    def residues(self) -> Residues:
        """Residues (e, m) and out-of-band terms (e, t)."""
        return unpack(self.coefficients, self.poles.size)

    @property
    def response(self) -> np.ndarray:
        """(e, F) of the fit."""
        return self.coefficients @ basis(self.data.lines, self.poles)

    @property
    def errors(self) -> np.ndarray:
        """(d, e, F) independent errors of the response, of one standard deviation each."""
        m, lines = self.poles.size, self.data.lines
        columns, slope = basis(lines, self.poles), basis_slope(lines, self.poles)
        each = self.coefficients.shape[1]
        own = self.root[2 * m :].reshape(-1, each, self.root.shape[1])
        return np.stack(
            [
                self.root[: 2 * m].T @ _by_poles(c, slope, m) + part.T @ columns
                for c, part in zip(self.coefficients, own, strict=True)
            ],
            axis=1,
        )

    def drawn(self, count: int, seed: int) -> list[tuple[np.ndarray, Residues]]:
        """So many poles and residues that are as likely as each other."""
        m = self.poles.size
        at = np.concatenate([self.poles.real, self.poles.imag])
        found = []
        for normal in np.random.default_rng(seed).standard_normal((count, self.root.shape[1])):
            by = self.root @ normal
            # Neither decay nor frequency is ever below zero, however unsure.
            real, imag = np.split(at * np.exp(np.clip(by[: 2 * m] / at, -1.0, 1.0)), 2)
            moved = self.coefficients + by[2 * m :].reshape(self.coefficients.shape)
            found.append((real + 1j * imag, unpack(moved, m)))
        return found


def shape_fit(data: Data, fit: PoleFit, entries: Entries) -> ShapeFit:
    """From a fit whose residues were free, of responses in the order of the `entries` (e,).

    Poles outside the lines, and those nearer to each other than their damping, keep free residues:
    they may stand for several modes.
    """
    problem = _ShapeProblem.of(data, fit, entries)
    point = problem.start(fit)
    for _ in range(STEPS):
        step = problem.step(point)
        tried = (problem.moved(point, step / 2**k) for k in range(HALVED))
        allowed = (problem.at(*values) for values in tried if data.allowed(values[0]))
        there = next((p for p in allowed if p.chi2 <= point.chi2), point)
        fall, point = point.chi2 - there.chi2, there
        if fall < SETTLED:
            break
    root = problem.root(point)
    freedom = 2 * data.entries * data.frequency_hz.size - root.shape[1]
    whole = problem.coefficients(point.shapes, point.free)
    return ShapeFit(data, point.poles, whole, root, point.chi2 / max(freedom, 1))


def _by_poles(coefficients: np.ndarray, slope: np.ndarray, m: int) -> np.ndarray:
    """(2m, F) change of one entry's response with the poles' real and imaginary parts."""
    real, imag = coefficients[:m, None], coefficients[m : 2 * m, None]
    first, second = slope[:m], slope[m:]
    return np.concatenate([real * first + imag * second, real * second - imag * first])


@dataclass(frozen=True, eq=False)
class _ShapePoint:
    """Poles (m,), shapes (k, n), coefficients (e, c), those of the shapes unused; χ², slope, N."""

    poles: np.ndarray
    shapes: np.ndarray
    free: np.ndarray
    chi2: float
    slope: np.ndarray
    normal: np.ndarray


@dataclass(frozen=True, eq=False)
class _ShapeProblem:
    """Responses and weights 2/variance (e, F); `shaped` are the modes that have one shape each."""

    data: Data
    response: np.ndarray
    weight: np.ndarray
    entries: Entries
    modes: int
    shaped: np.ndarray

    @classmethod
    def of(cls, data: Data, fit: PoleFit, entries: Entries) -> "_ShapeProblem":
        poles, count = fit.refined.poles, data.entries
        apart = np.abs(poles[:, None] - poles) + np.diag(np.full(poles.size, np.inf))
        wide = np.maximum(np.abs(poles.real)[:, None], np.abs(poles.real))
        alone = np.all(apart > wide / 2, axis=1)
        alone &= np.abs(poles) < 2 * np.pi * data.frequency_hz[-1]
        weight = 2 / fit.variance.reshape(count, -1)
        response = data.response.reshape(count, -1)
        return cls(data, response, weight, entries, poles.size, np.flatnonzero(alone))

    def start(self, fit: PoleFit) -> _ShapePoint:
        """Shapes that explain the free residues best."""
        refined, m = fit.refined, self.modes
        residue = refined.residues.residue.reshape(-1, m)
        variance = np.mean(refined.residue_variance, axis=2).reshape(-1, m)
        shapes = [
            fit_shape(self.entries, residue[:, k], variance[:, k], 0.5).shape / np.sqrt(1j)
            for k in self.shaped
        ]
        shape = np.array(shapes).reshape(-1, self.entries.points)
        free = refined.point.coefficients.copy()
        return self.at(refined.poles, shape, free)

    def coefficients(self, shapes: np.ndarray, free: np.ndarray) -> np.ndarray:
        """(e, c) of all modes."""
        out, e = free.copy(), self.entries
        residue = (shapes[:, e.rows] * shapes[:, e.columns]).T
        out[:, self.shaped], out[:, self.modes + self.shaped] = residue.real, residue.imag
        return out

    def at(self, poles: np.ndarray, shapes: np.ndarray, free: np.ndarray) -> _ShapePoint:
        """With χ², its slope (−½ of it) and half its curvature by poles and all coefficients."""
        lines, m = self.data.lines, self.modes
        columns, slope = basis(lines, poles), basis_slope(lines, poles)
        own, each = self.coefficients(shapes, free), len(columns)
        size = 2 * m + own.size
        normal, gradient, chi2 = np.zeros((size, size)), np.zeros(size), 0.0
        for e, (c, w) in enumerate(zip(own, self.weight, strict=True)):
            part = np.concatenate([_by_poles(c, slope, m), columns])
            off = self.response[e] - c @ columns
            index = np.r_[: 2 * m, 2 * m + e * each : 2 * m + (e + 1) * each]
            weighted = part.conj() * w
            normal[np.ix_(index, index)] += (weighted @ part.T).real
            gradient[index] += (weighted @ off).real
            chi2 += float(w @ np.abs(off) ** 2)
        return _ShapePoint(poles, shapes, free, chi2, gradient, normal)

    def tangent(self, point: _ShapePoint) -> np.ndarray:
        """(2m + e·c, u) change of poles and all coefficients with the unknowns.

        These are the poles, then Re φ and Im φ of every point mode by mode, then free coefficients.
        """
        m, e = self.modes, self.entries
        count, each = point.free.shape
        index = np.arange(count)
        residue = np.zeros((len(self.shaped), e.points, count), complex)
        for k, shape in enumerate(point.shapes):
            np.add.at(residue[k], (e.rows, index), shape[e.columns])
            np.add.at(residue[k], (e.columns, index), shape[e.rows])
        both = np.stack([residue, 1j * residue], axis=2)  # (k, points, 2, e)
        change = np.zeros((*both.shape, each))
        for k, mode in enumerate(self.shaped):
            change[k, ..., mode], change[k, ..., m + mode] = both[k].real, both[k].imag
        size = 2 * m + count * each
        out = np.zeros((size, 2 * m + 2 * e.points * len(self.shaped) + count * self.left.size))
        out[: 2 * m, : 2 * m] = np.eye(2 * m)
        end = 2 * m + 2 * e.points * len(self.shaped)
        out[2 * m :, 2 * m : end] = change.reshape(end - 2 * m, -1).T
        rows = 2 * m + each * index[:, None] + self.left
        out[rows.ravel(), end + np.arange(rows.size)] = 1.0
        return out

    @property
    def left(self) -> np.ndarray:
        """Columns of the coefficients that are free."""
        terms = 2 * (self.modes + len(self.data.lines.rest))
        return np.setdiff1d(np.arange(terms), np.r_[self.shaped, self.modes + self.shaped])

    def _scaled(self, point: _ShapePoint) -> tuple[np.ndarray, np.ndarray]:
        """Tangent in units that make the curvature one on its diagonal; root of its inverse."""
        tangent = self.tangent(point)
        normal = tangent.T @ point.normal @ tangent
        unit = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        values, vectors = np.linalg.eigh(normal / unit[:, None] / unit)
        kept = values > ROUNDING * values[-1]
        return tangent, vectors[:, kept] / np.sqrt(values[kept]) / unit[:, None]

    def root(self, point: _ShapePoint) -> np.ndarray:
        """(2m + e·c, d) independent errors."""
        tangent, root = self._scaled(point)
        return tangent @ root

    def step(self, point: _ShapePoint) -> np.ndarray:
        """(u,) of Gauss and Newton."""
        tangent, root = self._scaled(point)
        return root @ (root.T @ (tangent.T @ point.slope))

    def moved(
        self, point: _ShapePoint, step: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Poles, shapes and free coefficients after a step (u,)."""
        m, end = self.modes, 2 * self.modes + 2 * point.shapes.size
        parts = step[2 * m : end].reshape(*point.shapes.shape, 2)
        free = point.free.copy()
        free[:, self.left] += step[end:].reshape(len(free), -1)
        poles = point.poles + step[:m] + 1j * step[m : 2 * m]
        return poles, point.shapes + parts[..., 0] + 1j * parts[..., 1], free
