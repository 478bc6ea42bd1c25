"""A modal fit without what its FRFs do not ask for: the plainest that they do not speak against.

Few modes of a structure need all that a fit leaves free: modes outside the lines, motions that
differ in phase, FRFs that change when hit and sensor do. What the fit does not tell from nothing is
taken away (Wald) and the rest fitted again. That is surer by far where FRFs are small: beside a
resonance, between two, above all of them.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space
from scipy.stats import chi2

from planner.modal.fit_data import Data
from planner.modal.mode_selection import PoleFit
from planner.modal.residues import Residues, basis, basis_slope, unpack

CHANCE = 0.999  # of what is nothing not to be called something
SURELY = 1 - 1e-6  # that χ² rises by less where all of it is nothing: else nothing is taken away
ROUNDING, ALIKE = 1e-13, 1e-10  # shares of curvature and covariance that are rounding
STEPS, HALVED = 12, 6  # of the second fit, and how often a step is shortened
SETTLED = 1e-2  # fall of χ² in a step that is the last
FARTHEST = 1.0  # of ln decay or frequency in a sample: a pole that moves more is anything


@dataclass(frozen=True, eq=False)
class PlainModes:
    """Poles (m,) and coefficients (e, c) as one vector of values (2m + e·c,), and covariance.

    The poles' real parts, their imaginary parts, then entry by entry what `residues.basis` has.
    """

    poles: np.ndarray
    entries: int
    values: np.ndarray
    covariance: np.ndarray

    @classmethod
    def of(
        cls, data: Data, fit: PoleFit, scale: np.ndarray, pairs: list[tuple[int, int]]
    ) -> "PlainModes":
        """Of a fit whose variances grow by `scale` (m,) mode by mode.

        `pairs` are numbers of entries whose hit and sensor are each other's.
        """
        point, poles = fit.refined.point, fit.refined.poles
        entries, columns = point.coefficients.shape
        start = np.concatenate([poles.real, poles.imag, point.coefficients.ravel()])
        problem = _PlainProblem(data, data.response.reshape(entries, -1),
                           2 / fit.variance.reshape(entries, -1), poles.size)  # fmt: skip
        full = problem.at(start)
        held = _held(full, _nothings(poles.size, entries, columns, pairs))
        found, free = full, np.eye(len(start))
        if held:
            less = null_space(np.concatenate(held) * full.unit)
            most = chi2.ppf(SURELY, len(start) - less.shape[1])
            plain = problem.settled(full, less)
            if plain.chi2 - full.chi2 < most * max(1.0, full.chi2 / problem.freedom):
                found, free = plain, less
        rest = np.full(columns - 2 * poles.size, np.max(scale))
        grown = [np.tile(scale, 2), *[np.append(np.tile(scale, 2), rest)] * entries]
        root = np.sqrt(np.concatenate(grown))
        covariance = root[:, None] * found.covariance(free) * root
        return cls(problem.poles(found.values), entries, found.values, covariance)

    def modes(self) -> tuple[np.ndarray, Residues]:
        """Poles (m,) in rad/s and residues (e, m) with their out-of-band terms (e, t)."""
        return self._read(self.values)

    def drawn(self, count: int, seed: int) -> list[tuple[np.ndarray, Residues]]:
        """So many of them that are as likely as each other."""
        unit = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))
        values, vectors = np.linalg.eigh(self.covariance / unit[:, None] / unit)
        root = unit[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
        normal = np.random.default_rng(seed).standard_normal((count, len(values)))
        return [self._read(self.values + root @ row) for row in normal]

    def residue_variance(self) -> np.ndarray:
        """(e, m) of real and imaginary part together."""
        m = self.poles.size
        own = np.diag(self.covariance)[2 * m :].reshape(self.entries, -1)
        return own[:, :m] + own[:, m : 2 * m]

    def _read(self, values: np.ndarray) -> tuple[np.ndarray, Residues]:
        at = np.concatenate([self.poles.real, self.poles.imag])
        # Neither decay nor frequency is ever below zero, however unsure.
        by = np.clip((values[: at.size] - at) / at, -FARTHEST, FARTHEST)
        real, imag = np.split(at * np.exp(by), 2)
        coefficients = values[at.size :].reshape(self.entries, -1)
        return real + 1j * imag, unpack(coefficients, self.poles.size)


@dataclass(frozen=True, eq=False)
class _FitPoint:
    """χ² at values (n,), its slope (n,) and curvature (n, n)/2, in units (n,) of which it is 1."""

    values: np.ndarray
    chi2: float
    unit: np.ndarray
    slope: np.ndarray
    normal: np.ndarray

    def inside(self, free: np.ndarray) -> np.ndarray:
        """(r, r) covariance along `free` (n, r), in these units."""
        return np.linalg.pinv(free.T @ self.normal @ free, rcond=ROUNDING, hermitian=True)

    def covariance(self, free: np.ndarray) -> np.ndarray:
        """(n, n) where values only move along `free` (n, r), in these units."""
        return self.unit[:, None] * (free @ self.inside(free) @ free.T) * self.unit


@dataclass(frozen=True, eq=False)
class _PlainProblem:
    """Responses (e, F) and weights 2/variance to be fitted by so many modes."""

    data: Data
    response: np.ndarray
    weight: np.ndarray
    modes: int

    @property
    def freedom(self) -> int:
        """Real values that are fitted."""
        return 2 * self.response.size

    def poles(self, values: np.ndarray) -> np.ndarray:
        """(m,) of all values."""
        return values[: self.modes] + 1j * values[self.modes : 2 * self.modes]

    def at(self, values: np.ndarray, unit: np.ndarray | None = None) -> _FitPoint:
        """The point; units of its own curvature where none are given."""
        poles, m, lines = self.poles(values), self.modes, self.data.lines
        columns, slope = basis(lines, poles), basis_slope(lines, poles)
        own = values[2 * m :].reshape(len(self.response), -1)
        n, each = len(values), own.shape[1]
        normal, gradient, square = np.zeros((n, n)), np.zeros(n), 0.0
        for e, (c, w) in enumerate(zip(own, self.weight, strict=True)):
            real, imag = c[:m, None], c[m : 2 * m, None]
            first, second = slope[:m], slope[m:]
            moved = [real * first + imag * second, real * second - imag * first, columns]
            a = np.concatenate(moved)
            off = self.response[e] - c @ columns
            index = np.r_[: 2 * m, 2 * m + e * each : 2 * m + (e + 1) * each]
            weighted = a.conj() * w
            normal[np.ix_(index, index)] += (weighted @ a.T).real
            gradient[index] += (weighted @ off).real
            square += float(w @ np.abs(off) ** 2)
        unit = 1 / np.sqrt(np.diag(normal)) if unit is None else unit
        return _FitPoint(values, square, unit, unit * gradient, unit[:, None] * normal * unit)

    def settled(self, start: _FitPoint, free: np.ndarray) -> _FitPoint:
        """Where χ² is least with values along `free` (n, r) alone, in the start's units."""
        here = free @ (start.inside(free) @ (free.T @ start.normal @ (start.values / start.unit)))
        own = 2 * self.modes  # poles stay for once, if the step is too far
        values = np.concatenate([start.values[:own], (start.unit * here)[own:]])
        point = self.at(values, start.unit)
        for _ in range(STEPS):
            step = start.unit * (free @ (point.inside(free) @ (free.T @ point.slope)))
            tried = (point.values + step / 2**k for k in range(HALVED))
            allowed = (self.at(v, start.unit) for v in tried if self.data.allowed(self.poles(v)))
            there = next((one for one in allowed if one.chi2 <= point.chi2), point)
            fall, point = point.chi2 - there.chi2, there
            if fall < SETTLED:
                break
        return point


def _held(full: _FitPoint, groups: list[np.ndarray]) -> list[np.ndarray]:
    """The combinations of values that are nothing as far as the fit tells."""
    values = full.values / full.unit
    held: list[np.ndarray] = []
    covariance = full.inside(np.eye(len(values)))
    for group in groups:
        rows = group * full.unit
        rows = rows / np.linalg.norm(rows, axis=1)[:, None]
        along = covariance @ rows.T
        inverse = np.linalg.pinv(rows @ along, rcond=ALIKE, hermitian=True)
        off = rows @ values
        if off @ inverse @ off > chi2.ppf(CHANCE, len(rows)):
            continue
        gain = along @ inverse
        values, covariance = values - gain @ off, covariance - gain @ along.T
        held.append(group)
    return held


def _nothings(m: int, entries: int, columns: int, pairs: list[tuple[int, int]]) -> list[np.ndarray]:
    """Combinations (r, n) of the values that may each be nothing, one thing after the other."""
    terms = (columns - 2 * m) // 2
    unit = np.eye(2 * m + entries * columns)
    at = 2 * m + columns * np.arange(entries)
    rest = at[:, None] + 2 * m + np.arange(2 * terms)  # (e, real then imaginary parts)
    found = [unit[rest[:, [k, terms + k]].ravel()] for k in range(terms)]
    found.append(unit[rest[:, terms:].ravel()])
    for k in range(m):
        parts = np.array([k, m + k])
        if pairs:
            found.append(
                np.concatenate([unit[at[i] + parts] - unit[at[j] + parts] for i, j in pairs])
            )
        found.append(unit[at + k])
    return found
