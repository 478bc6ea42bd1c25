"""What differs between hits of different force, weighed: evidence, size, and the play of chance."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.diagnosis.levels_hits import HitGroup

QUARTER, SMALL = 0.25, 0.01  # of values; the discrepancy beside which noise is looked at
DRAWS = 999  # orders of hits that are tried
Values = Sequence[np.ndarray]  # of each group (n, 3, L), or columns (C, n, 3, L)


@dataclass(frozen=True, eq=False)
class WeighedGroup:
    """A group with a discrepancy of a share ρ of the FRFs' size, that each hit has for itself.

    What all hits have in common is left open, and so are the misses of each.
    """

    group: HitGroup
    rho: float

    @cached_property
    def variance(self) -> np.ndarray:
        """(n, 3, L) of values."""
        return self.group.variance + (self.rho * self.group.size) ** 2

    def white(self, values: np.ndarray) -> np.ndarray:
        """(C, N) real in units of the noise, of (C, n, 3, L), what is common taken out."""
        weight = np.sqrt(2 / self.variance)
        common = weight / np.sqrt(np.sum(weight**2, axis=0))
        out = values * weight
        out -= common * np.sum(common * out, axis=1, keepdims=True)
        return out.reshape(len(out), -1).view(float)

    @cached_property
    def hit_errors(self) -> tuple[np.ndarray, np.ndarray]:
        """B (4 n, N), and the inverse of the Cholesky factor of I + B Bᵀ."""
        b = self.white(self.group.hit_errors)
        return b, np.linalg.inv(np.linalg.cholesky(np.eye(len(b)) + b @ b.T))

    @cached_property
    def volume(self) -> float:
        """−ln of the volume in which FRFs may lie."""
        logs = np.log(self.variance).sum() + np.log(np.sum(1 / self.variance, axis=0)).sum()
        return float(np.log(np.diag(self.hit_errors[1])).sum() - logs)

    def gram(self, values: np.ndarray) -> np.ndarray:
        """(C, C) of values (C, n, 3, L), misses integrated out."""
        white, (b, inverse) = self.white(values), self.hit_errors
        taken = white @ b.T @ inverse.T
        return white @ white.T - taken @ taken.T

    def without_hit_errors(self, values: np.ndarray) -> np.ndarray:
        """Values (n, 3, L) without the likeliest misses and what is common."""
        b, inverse = self.hit_errors
        eta = inverse.T @ (inverse @ (b @ self.white(values[None])[0]))
        left = values - np.tensordot(eta, self.group.hit_errors, 1)
        return left - left.mean(axis=0)


Weighed = Sequence[WeighedGroup]


def coloured(groups: Sequence[HitGroup]) -> tuple[HitGroup, ...]:
    """With as much noise at each line as the softest hits show: floors rumble at low frequencies.

    That of the quarter of values that differ least: where a joint bends, the rest may say so.
    """
    ratios = []
    for g in groups:
        n, soft = len(g.peak_n), int(np.argmin(g.peak_n))
        off = WeighedGroup(g, SMALL).without_hit_errors(g.accelerance)[soft] * n / (n - 1)
        ratios.append(np.abs(off) ** 2 / g.variance[soft])
    least = np.quantile(np.array(ratios), QUARTER, axis=(0, 1)) / -np.log(1 - QUARTER)
    return tuple(replace(g, variance=g.variance * np.maximum(least, 1.0)) for g in groups)


def gram_of(weighed: Weighed, columns: Values) -> np.ndarray:
    """(C, C) of columns of all groups."""
    return np.sum([w.gram(c) for w, c in zip(weighed, columns, strict=True)], axis=0)


def evidence(weighed: Weighed, left: Values) -> float:
    """ln of the likelihood of what is left (n, 3, L) of each group."""
    chi2 = gram_of(weighed, [v[None] for v in left])[0, 0]
    return sum(w.volume for w in weighed) - 0.5 * float(chi2)


@dataclass(frozen=True)
class Differences:
    """`size`: by which share of |H| hits differ in the course of their force, more than by chance.

    `chance` is that of so much, were hits of a group exchangeable; 1 where no order could tell.
    """

    size: float
    chance: float

    def matter(self, size: float, chance: float) -> bool:
        """Whether they are that large, and so improbable by chance."""
        return self.size >= size and self.chance <= chance


def differences(weighed: Weighed, left: Values) -> Differences:
    """Hits of a linear robot follow no course with the force: three or more of a group tell.

    Nothing is assumed of how large misses are, but that hits of any force miss alike. All are given
    as much noise as the noisiest has: soft ones have more. Where no group has three, all of what is
    there is the size, which nothing but a law can tell from chance.
    """
    rng = np.random.default_rng(0)
    courses, told, least = 0.0, np.zeros(1 + DRAWS), min(3, max(len(v) for v in left))
    for w, values in zip(weighed, left, strict=True):
        g, n = w.group, len(values)
        lacking = np.sqrt((g.variance.max(axis=0) - g.variance) / 2)
        if n < least:
            continue
        noise = rng.standard_normal((2, *values.shape))
        off = w.without_hit_errors(values + lacking * (noise[0] + 1j * noise[1]))
        course = np.log(g.peak_n) - np.log(g.peak_n).mean()
        course /= np.linalg.norm(course)
        along = float(np.sum(np.abs(np.tensordot(course, off, 1)) ** 2))
        whole = float(np.sum(np.abs(off) ** 2))
        courses += ((n - 1) * along - whole) / (n - 2) if n > 2 else whole
        flat = (off / np.sqrt(w.variance.max(axis=0))).reshape(n, -1).view(float)
        orders = rng.permuted(np.tile(np.arange(n), (DRAWS, 1)), axis=1)
        each = np.concatenate([course[None], course[orders]])
        share = np.sum((each @ flat @ flat.T) * each, axis=1) / np.sum(flat**2)
        told -= n / 2 * np.log(np.maximum(1 - share, 1e-12))
    chance = (1 + int(np.count_nonzero(told[1:] >= told[0] - 1e-9))) / (1 + DRAWS)
    share = max(courses, 0.0) / power([w.group for w in weighed])
    return Differences(float(np.sqrt(share)), chance)


def power(groups: Sequence[HitGroup]) -> float:
    """Σ |H|² of all hits."""
    return sum(float(np.sum(np.abs(g.accelerance) ** 2)) for g in groups)


def share_of(groups: Sequence[HitGroup], changes: Values) -> float:
    """By which share of |H| hits of a group differ by changes (n, 3, L)."""
    off = sum(float(np.sum(np.abs(c - c.mean(axis=0)) ** 2)) for c in changes)
    return float(np.sqrt(off / power(groups)))
