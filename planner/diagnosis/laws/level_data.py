"""What laws of a joint are fitted to: strongest hits, and differences of weaker ones to them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.dataset.dataset import Dataset
from planner.dataset.level_columns import Column
from planner.diagnosis.laws.equivalent_stiffness import Equivalent, system_of
from planner.diagnosis.laws.one_joint_response import FASTEST, Strokes, spectra, strokes
from planner.diagnosis.laws.open_misses import OpenMisses, Whitening, whitening
from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.thresholds import LAW_DIFFERENCE_ERROR, LAW_MODEL_ERROR
from planner.dynamics.gradient import Impedance, response_gradient
from planner.measurement.nuisances import real_rows

LINES = 64
LAID = 4.0  # rate (1/s) of the window: so that 1.3 s of each hit are enough


@dataclass(frozen=True, eq=False)
class OpenColumns:
    """What misses leave open in some `columns` (b,) of LevelData: basis (l, b, 3, F)."""

    columns: np.ndarray
    basis: np.ndarray


@dataclass(frozen=True, eq=False)
class LevelData:
    """c columns of n visits on common lines s (F,): FRFs h (c, 3, F), `best` (c,) the strongest.

    `weight` (c, 3, F) is 1/E|error|² of what is compared: a strongest column itself, the
    difference to it of a weaker one. `force` (c, F) in N·s are the spectra of `hits`, poles above
    `fastest_hz` are taken to follow at once.
    """

    s: np.ndarray
    h: np.ndarray
    weight: np.ndarray
    best: np.ndarray
    level: np.ndarray  # (c,)
    hits: Strokes
    force: np.ndarray
    fastest_hz: float
    left_open: tuple[OpenColumns, ...] = ()

    @property
    def weaker(self) -> np.ndarray:
        """(c, 1, 1) bool: columns of which the difference to the strongest is compared."""
        return (self.best != np.arange(len(self.h)))[:, None, None]

    def compared(self, h: np.ndarray) -> np.ndarray:
        """Strongest columns as they are, weaker ones as differences to them; h (..., c, 3, F)."""
        return np.where(self.weaker, h - h[..., self.best, :, :], h)

    @cached_property
    def _whitenings(self) -> list[Whitening]:
        return [whitening(o.basis, self.weight[o.columns]) for o in self.left_open]

    def scaled(self, values: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
        """Real rows (k, N) of what is compared (k, c, 3, F) in units of its errors.

        What misses leave open is taken out. With `rows` (b,) values hold these columns only, all
        strongest ones or all columns.
        """
        rows = np.arange(len(self.h)) if rows is None else rows
        out = real_rows(values * np.sqrt(self.weight[rows])).reshape(len(values), len(rows), -1)
        place = {int(row): i for i, row in enumerate(rows)}
        for left, white in zip(self.left_open, self._whitenings, strict=True):
            at = [place[c] for c in left.columns.tolist() if c in place]
            if at:
                part = out[:, at].reshape(len(values), -1)
                out[:, at] = white(part).reshape(len(values), len(at), -1)
        return out.reshape(len(values), -1)

    def of_rows(self, scaled: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Those parts of scaled values (k, N) that belong to the columns `rows` (b,)."""
        return scaled.reshape(len(scaled), len(self.h), -1)[:, rows].reshape(len(scaled), -1)

    def chi2(self, values: np.ndarray) -> np.ndarray:
        """(c,): Σ weight |value|² of each column (c, 3, F), with misses left open."""
        each = self.scaled(values[None]).reshape(len(self.h), -1)
        return np.sum(each**2, axis=1)


@dataclass(frozen=True, eq=False)
class LinearSlopes:
    """Derivatives by the D linear parameters of what is compared, in units of its errors.

    `scaled` (D, N) are real and imaginary parts for the columns `rows` (b,), 0 for all others;
    `gram` (D, D) is their product with themselves.
    """

    rows: np.ndarray
    scaled: np.ndarray
    gram: np.ndarray

    @classmethod
    def of(cls, data: LevelData, slope: np.ndarray, rows: np.ndarray) -> "LinearSlopes":
        """From derivatives (b, D, 3, F) of the columns `rows` (b,)."""
        scaled = data.scaled(np.swapaxes(slope, 0, 1), rows)
        return cls(rows, scaled, scaled @ scaled.T)


def level_data(recorded: Dataset, plain: Fit, misses: OpenMisses | None = None) -> LevelData:
    """Columns of all visits on lines of their own; `misses` of their hits are left open."""
    columns: list[Column] = []
    visits: list[int] = []
    for number, group in enumerate(recorded.columns_at(LAID)):
        columns += group
        visits += [number] * len(group)
    frequency = columns[0].frequency_hz
    lines = np.unique(np.linspace(0, len(frequency) - 1, LINES).round().astype(int))
    s = 2j * np.pi * frequency[lines] + columns[0].rate_1_s
    h = np.array([c.accelerance[:, lines] for c in columns])
    variance = np.array([c.variance[:, lines] for c in columns])
    places = [(v, c.axis) for v, c in zip(visits, columns, strict=True)]
    best = np.array([max(i for i, p in enumerate(places) if p == place) for place in places])
    weaker = best != np.arange(len(best))
    change = np.abs(h - h[best])
    error = np.where(
        weaker[:, None, None],
        variance
        + variance[best]
        + (LAW_MODEL_ERROR * change) ** 2
        + (LAW_DIFFERENCE_ERROR * np.abs(h)) ** 2,
        variance + (LAW_MODEL_ERROR * np.abs(h)) ** 2,
    )
    left: list[OpenColumns] = []
    for visit in sorted(set(visits)):
        if misses is None:
            break
        found, variance = _left_open(columns, places, best, visit, misses, lines)
        left += found
        error = error + variance
    weight = np.where(np.isfinite(error), 1 / error, 0.0)
    hits = strokes(visits, columns)
    force = spectra(hits.force.T, hits, s)
    level = np.array([c.level for c in columns])
    return LevelData(
        s, h, weight, best, level, hits, force, FASTEST * float(frequency[-1]), tuple(left)
    )


def _left_open(
    columns: list[Column],
    places: list[tuple[int, int]],
    best: np.ndarray,
    visit: int,
    misses: OpenMisses,
    lines: np.ndarray,
) -> tuple[list[OpenColumns], np.ndarray]:
    """What misses leave open at a visit, and E|error|² (c, 3, F) of the simulation's part in it.

    The strongest columns are opened together, to the measuring chain as well; of its part in
    differences there is LAW_MODEL_ERROR.
    """
    here = [c for c, (v, _) in enumerate(places) if v == visit]
    strongest = [c for c in here if best[c] == c]
    hits = misses.of_hits(visit, [columns[c] for c in here], lines)
    chain = misses.of_chain(visit, columns[0], lines)
    variance = np.zeros((len(columns), 3, len(lines)))
    whole = [np.zeros((len(chain), len(strongest), 3, len(lines)), dtype=complex)]
    out: list[OpenColumns] = []
    for i, c in enumerate(strongest):
        axis = places[c][1]
        whole[0][:, i] = chain[:, :, axis]
        own, variance[c] = hits.left_open([columns[c]])
        # An aim that all hits along the axis have in common, and each one's own.
        own = np.concatenate([hits.basis[axis], own])
        whole.append(np.zeros((len(own), len(strongest), 3, len(lines)), dtype=complex))
        whole[-1][:, i] = own
        for w in here:
            if best[w] == c and w != c:
                basis, variance[w] = hits.left_open([columns[w], columns[c]])
                out.append(OpenColumns(np.array([w]), basis[:, None]))
    out.append(OpenColumns(np.array(strongest), np.concatenate(whole)))
    return out, variance


def strongest_slopes(data: LevelData, plain: Fit) -> LinearSlopes:
    """What the linear simulation says of the strongest columns, where it fits best."""
    rows = np.flatnonzero(~data.weaker[:, 0, 0])
    slope = _slopes(plain, data.s, plain.x)[data.hits.visit[rows], :, :, data.hits.axis[rows]]
    return LinearSlopes.of(data, slope, rows)


def equivalent_slopes(
    data: LevelData, plain: Fit, found: Equivalent, port: int, x: np.ndarray
) -> LinearSlopes:
    """Derivatives at x, of the differences too, with the stiffness that each column tells.

    Every column has the stiffness that the joint has for it: that of the linear fit at the highest
    level, and Δ more at the others. How far a joint swings depends on inertias and springs:
    without the differences' derivatives, k would seem to be known better than it is.
    """
    visit, axis = data.hits.visit, data.hits.axis
    block = int(system_of(plain).blocks[port])
    strongest = system_of(plain).elasticity.stiffness[block]
    there = strongest - system_of(plain, x).elasticity.stiffness[block]
    places = zip(found.visit.tolist(), found.axis.tolist(), found.level.tolist(), strict=True)
    delta = dict(zip(places, found.delta[:, port], strict=True))
    n, blocks = int(visit.max()) + 1, np.array([block])
    slope = np.zeros((len(data.h), len(plain.x), 3, len(data.s)), dtype=complex)
    plainly = _slopes(plain, data.s, x, blocks, np.full((n, 1), there))
    for a, level in sorted({(int(i), int(j)) for _, i, j in delta}):
        stiffer = np.array([there + delta.get((v, a, level), 0.0) for v in range(n)])
        moved = _slopes(plain, data.s, x, blocks, stiffer[:, None])
        for c in np.flatnonzero((axis == a) & (data.level == level)):
            slope[c] = moved[visit[c], :, :, a] - plainly[visit[c], :, :, a]
    for c in np.flatnonzero(~data.weaker[:, 0, 0]):
        slope[c] = plainly[visit[c], :, :, axis[c]]
    return LinearSlopes.of(data, slope, np.arange(len(data.h)))


def stiffened_slopes(
    data: LevelData, plain: Fit, x: np.ndarray, blocks: np.ndarray, stiffer: np.ndarray
) -> LinearSlopes:
    """Derivatives at x of every column, whose springs `blocks` are `stiffer` (c, m) N·m/rad."""
    visit, axis = data.hits.visit, data.hits.axis
    n = int(visit.max()) + 1
    slope = np.zeros((len(data.h), len(plain.x), 3, len(data.s)), dtype=complex)
    places = sorted({(int(a), int(level)) for a, level in zip(axis, data.level, strict=True)})
    for a, level in places:
        here = np.flatnonzero((axis == a) & (data.level == level))
        there = np.zeros((n, len(blocks)))
        there[visit[here]] = stiffer[here]
        slope[here] = _slopes(plain, data.s, x, blocks, there)[visit[here], :, :, a]
    slope = np.swapaxes(data.compared(np.swapaxes(slope, 0, 1)), 0, 1)
    return LinearSlopes.of(data, slope, np.arange(len(data.h)))


def _slopes(
    plain: Fit,
    s: np.ndarray,
    x: np.ndarray,
    blocks: np.ndarray | None = None,
    stiffer: np.ndarray | None = None,
) -> np.ndarray:
    """Derivatives (n, D, 3, 3, F) at x, springs `blocks` (m,) being `stiffer` (n, m), complex."""
    misfit = plain.misfit
    a, b = misfit.split
    p, n = misfit.parametrisation, len(misfit.matrices.mass)
    mass = misfit.matrices.mass + misfit.inertias.mass_change(x[a:b])
    every = np.broadcast_to(s, (n, len(s)))
    added = ()
    if blocks is not None and stiffer is not None:
        for j, block in enumerate(blocks):
            port = np.zeros((n, 1, p.size))
            port[:, 0, block] = 1.0
            spring = np.broadcast_to(stiffer[:, j, None], every.shape)
            added += (Impedance(port, np.ones((1, 1, 1)), ((0, spring),)),)
    full = response_gradient(
        misfit.matrices, p.elasticity(x[:a]), every, mass, misfit.inertias, added
    )[1]
    springs = len(p.held)
    theta = np.einsum("np...,pq->nq...", full[:, :springs], p.spread, optimize=True)
    return np.concatenate([theta, full[:, springs:]], axis=1)


def own_parameter(plain: Fit, block: int) -> int:
    """Which entry of x is the logarithm of a spring's stiffness."""
    for i, parameter in enumerate(plain.misfit.parametrisation.parameters):
        if parameter.kind == "stiffness" and block in parameter.blocks:
            return i
    raise ValueError("the joint's spring is no parameter")
