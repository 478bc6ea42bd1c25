"""What the misses of hits leave open where force levels are compared, integrated out.

No two hits along an axis miss alike, so that FRFs of two levels differ even where the structure is
linear: by B η, B being the simulation's responses to forces across the axis and to moments, and η
four numbers with normal priors (see `measurement.nuisances`). Integrating over η takes
the directions B out of what is compared as far as the prior lets them be taken. What B is wrong by
is counted as an error besides.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from planner.dataset.dataset import LAID, Dataset
from planner.dataset.level_columns import Column, column
from planner.diagnosis.linear.fit import Fit
from planner.dynamics.gradient import response_turned
from planner.measurement.nuisances import (
    ACROSS,
    Tolerances,
    chain_basis,
    hit_basis,
    real_rows,
)
from planner.recording.force_levels import peak_n

RELATIVE = 0.01  # of B: what no simulation is right to, however well it fits
# Of what a tilt does, as hits along the other axes tell it that miss by themselves.
TILTED = 0.03
RAISED = 6  # times at most that B is taken to be less certain, until repeats agree
MOST_UNCERTAIN = 1.0  # share of B: a joint that is not linear answers no two hits alike
LINES = 128  # most lines a column


def relative_misfit(plain: Fit) -> np.ndarray:
    """(n,): by which share a fitted simulation misses the FRFs of each visit."""
    measured, h = plain.misfit.measured, plain.misfit.response(plain.x)[0]
    off = np.where(measured.used, np.abs(h - measured.accelerance) ** 2, 0.0)
    size = np.where(measured.used, np.abs(measured.accelerance) ** 2, 0.0)
    return np.sqrt(off.sum(axis=(1, 2, 3)) / size.sum(axis=(1, 2, 3)))


def stronger(column: Column) -> float:
    """How much harder than its first hit a column's hits are as they count in H1.

    What a law adds to a spring goes about as the square of the swing, and H1 weighs hits by the
    square of their force.
    """
    square = np.array([peak_n(hit) ** 2 for hit in column.hits])
    return float(np.sqrt(np.sum(square**2) / np.sum(square) / square[0]))


@dataclass(frozen=True, eq=False)
class MissesAtVisit:
    """What misses of hits at a visit do at some `lines` (F,) of its columns.

    `basis` (3, 4, 3, F) is B of a hit along each axis, per prior sd: two tilts, two offsets. `off`
    (3, 4) is the share of each that is uncertain.
    """

    lines: np.ndarray
    basis: np.ndarray
    off: np.ndarray

    def left_open(self, columns: Sequence[Column]) -> tuple[np.ndarray, np.ndarray]:
        """What all the hits of columns along one axis leave open in differences between these.

        Returns the basis (4 n, 3, F) of all n hits, and E|error|² (3, F) because B is not right. H1
        weighs hits by the power of their force at each line: what several miss by in the mean goes
        with the frequency.
        """
        axis = columns[0].axis
        shares = np.concatenate([column.share[:, self.lines] for column in columns])
        whole = shares[:, None, None] * self.basis[axis]
        variance = np.einsum("k,nkif->if", self.off[axis] ** 2, np.abs(whole) ** 2)
        return whole.reshape(-1, *whole.shape[2:]), variance


@dataclass(frozen=True, eq=False)
class OpenMisses:
    """What hits miss by, as the linear fit `plain` to n visits answers it.

    What a tilt does is told by the hits along the other axes, where there are any: that holds
    whatever the simulation lacks. Only what an offset does is the simulation's own.
    """

    plain: Fit
    tolerances: Tolerances
    off: np.ndarray  # (n,): the share of the simulation's B that is uncertain

    @classmethod
    def told(cls, plain: Fit, recorded: Dataset, tolerances: Tolerances) -> "OpenMisses":
        """By how well the simulation fits, and by the repeats at one level, if there are any.

        B is so uncertain at each visit that its repeats differ no more than is left open, unless
        that were more than all of it.
        """
        off = np.hypot(RELATIVE, relative_misfit(plain))
        for number, hits in enumerate(hit_columns(recorded)):
            pairs = list(_alike(hits))
            for _ in range(RAISED if pairs else 0):
                left = _left(cls(plain, tolerances, off).of_hits(number, hits), pairs)
                if left <= 1:
                    break
                off[number] = min(off[number] * np.sqrt(left), MOST_UNCERTAIN)
        return cls(plain, tolerances, off)

    def of_hits(
        self, visit: int, columns: Sequence[Column], lines: np.ndarray | None = None
    ) -> MissesAtVisit:
        """At some lines of a visit's columns."""
        lines = lines_of(columns[0]) if lines is None else lines
        basis = hit_basis(*self._responses(visit, columns[0], lines)[:2], self.tolerances)[0]
        off = np.full((3, 4), self.off[visit])
        for axis in {c.axis for c in columns}:
            group = [c for c in columns if c.axis == axis]
            hits = [len(c.hits) for c in group]
            mean = np.average([c.accelerance[:, lines] for c in group], axis=0, weights=hits)
            for hit in range(3):
                for tilt in np.flatnonzero(np.array(ACROSS[hit]) == axis):
                    basis[hit, tilt] = self.tolerances.angle_rad * mean
                    off[hit, tilt] = TILTED
        return MissesAtVisit(lines, basis, off)

    def of_chain(self, visit: int, one: Column, lines: np.ndarray) -> np.ndarray:
        """Changes (14, 3, 3, F) of all FRFs by the measuring chain's tolerance."""
        h, _, turning = self._responses(visit, one, lines)
        return chain_basis(h, turning, s_of(one, lines)[None], self.tolerances)[0]

    def _responses(
        self, visit: int, one: Column, lines: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Accelerances, those of moments, and the sensor's turning: (1, 3, 3, F) each."""
        misfit, (a, b) = self.plain.misfit, self.plain.misfit.split
        at, x = slice(visit, visit + 1), self.plain.x
        mass = misfit.matrices.mass + misfit.inertias.mass_change(x[a:b])
        springs = misfit.parametrisation.elasticity(x[:a])
        s = s_of(one, lines)[None]
        h, turned = response_turned(misfit.matrices.at(at), springs, s, mass[at])
        return h, turned.moment, turned.turning


def s_of(column: Column, lines: np.ndarray) -> np.ndarray:
    """s (F,) in rad/s at some lines of a column."""
    return 2j * np.pi * column.frequency_hz[lines] + column.rate_1_s


def _left(misses: MissesAtVisit, pairs: Sequence[tuple[Column, Column]]) -> float:
    """χ² per value by which hits of one level differ beyond what is left open."""
    total, count = 0.0, 0
    for one, other in pairs:
        pair = Pair.of(one, other, misses.lines).opened(misses)
        total += float(pair.product(pair.change, pair.change))
        count += np.count_nonzero(pair.weight)
    return total / max(count, 1)


@dataclass(frozen=True, eq=False)
class Whitening:
    """Takes a basis out of real vectors (…, m) with unit noise: r → (I + B Bᵀ)^(−1/2) r."""

    directions: np.ndarray  # (l, m), orthonormal
    taken: np.ndarray  # (l,): the share of each that is taken

    @classmethod
    def of(cls, basis: np.ndarray) -> "Whitening":
        """From a basis (l, m) in units of the noise, per prior sd."""
        _, size, directions = np.linalg.svd(basis, full_matrices=False)
        return cls(directions, 1 - 1 / np.sqrt(1 + size**2))

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Of values (..., m)."""
        return values - ((values @ self.directions.T) * self.taken) @ self.directions


def whitening(basis: np.ndarray, weight: np.ndarray) -> Whitening:
    """Of complex values with errors of E|·|² = 1/weight and a basis (l, ...) of the same shape.

    It acts on `real_rows` of the values times √weight, whose real and imaginary parts have a
    variance of a half each.
    """
    return Whitening.of(np.sqrt(2.0) * real_rows(basis * np.sqrt(weight)))


@dataclass(frozen=True, eq=False)
class Pair:
    """Differences `change` (3, F) between two columns at some `lines`.

    `weight` (3, F) is 1/E|error|². `miss` takes out what misses leave open, None where hits are
    exact.
    """

    columns: tuple[Column, Column]
    lines: np.ndarray
    change: np.ndarray
    weight: np.ndarray
    miss: Whitening | None = None

    @classmethod
    def of(cls, one: Column, other: Column, lines: np.ndarray) -> "Pair":
        """On some of the columns' lines."""
        variance = (one.variance + other.variance)[:, lines]
        change = (one.accelerance - other.accelerance)[:, lines]
        return cls((one, other), lines, change, _inverse(variance))

    def opened(self, misses: MissesAtVisit) -> "Pair":
        """With the misses of both columns' hits left open."""
        basis, uncertain = misses.left_open(self.columns)
        variance = np.where(self.weight > 0, 1 / np.maximum(self.weight, 1e-300), np.inf)
        weight = _inverse(variance + uncertain)
        return Pair(self.columns, self.lines, self.change, weight, whitening(basis, weight))

    def product(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Re Σ a* b over (3, F), weighted; a and b are (3, F, ...)."""
        root = np.sqrt(self.weight).reshape(self.weight.shape + (1,) * (a.ndim - 2))
        a, b = root * a, root * b
        out = np.sum((a.conj() * b).real, axis=(0, 1))
        if self.miss is not None:
            directions = self.miss.directions.view(complex).conj()
            lost = 1 - (1 - self.miss.taken) ** 2
            along, across = ((directions @ v.reshape(directions.shape[1], -1)).real for v in (a, b))
            out = out - (lost @ (along * across)).reshape(out.shape)
        return out


def _inverse(variance: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(variance), 1 / variance, 0.0)


def lines_of(column: Column) -> np.ndarray:
    """Numbers of the lines that are looked at."""
    last = len(column.frequency_hz) - 1
    return np.unique(np.linspace(0, last, LINES).round().astype(int))


def hit_columns(recorded: Dataset) -> list[tuple[Column, ...]]:
    """Of each visit, a column for every hit by itself."""
    length = max(len(hit.force_n) for visit in recorded.visits for hit in visit.hits)
    rate = recorded.window_rate_1_s
    return [
        tuple(
            column(
                (hit,), hit.axis_index, recorded.level(hit), length, recorded.band_hz, LAID, rate
            )
            for hit in visit.hits
        )
        for visit in recorded.visits
    ]


def _alike(hits: Sequence[Column]) -> Iterator[tuple[Column, Column]]:
    """Neighbours among the hits of one axis and level."""
    groups: dict[tuple[int, int], Column] = {}
    for hit in hits:
        at = hit.axis, hit.level
        if at in groups:
            yield groups[at], hit
        groups[at] = hit
