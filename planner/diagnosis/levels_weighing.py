"""What differs between hits of different force, weighed: evidence, size, and the play of chance."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.diagnosis.levels_hits import HitGroup

DRAWS = 999  # orders of levels that are tried
Values = Sequence[np.ndarray]  # of each group (n, 3, L), or columns (C, n, 3, L)


@dataclass(frozen=True, eq=False)
class _Weighed:
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
    def misses(self) -> np.ndarray:
        """(4 n, N)."""
        return self.white(self.group.misses)

    @cached_property
    def inverse(self) -> np.ndarray:
        """(4 n, 4 n): of the Cholesky factor of I + B Bᵀ."""
        b = self.misses
        return np.linalg.inv(np.linalg.cholesky(np.eye(len(b)) + b @ b.T))

    @cached_property
    def volume(self) -> float:
        """−ln of the volume in which FRFs may lie."""
        logs = np.log(self.variance).sum() + np.log(np.sum(1 / self.variance, axis=0)).sum()
        return float(np.log(np.diag(self.inverse)).sum() - logs)

    def gram(self, values: np.ndarray) -> np.ndarray:
        """(C, C) of values (C, n, 3, L), misses integrated out."""
        white = self.white(values)
        taken = white @ self.misses.T @ self.inverse.T
        return white @ white.T - taken @ taken.T

    def without_misses(self, values: np.ndarray) -> np.ndarray:
        """Values (n, 3, L) without the likeliest misses and what is common."""
        onto = self.misses @ self.white(values[None])[0]
        eta = self.inverse.T @ (self.inverse @ onto)
        left = values - np.tensordot(eta, self.group.misses, 1)
        return left - left.mean(axis=0)


@dataclass(frozen=True, eq=False)
class Weighing:
    """All groups at one ρ."""

    groups: Sequence[HitGroup]
    rho: float

    @cached_property
    def _each(self) -> list[_Weighed]:
        return [_Weighed(group, self.rho) for group in self.groups]

    @cached_property
    def volume(self) -> float:
        """−ln of the volume in which FRFs may lie."""
        return sum(w.volume for w in self._each)

    def gram(self, values: Values) -> np.ndarray:
        """(C, C) of columns in each group."""
        return sum(
            (w.gram(v) for w, v in zip(self._each, values, strict=True)),
            np.zeros((len(values[0]),) * 2),
        )

    def evidence(self, left: Values) -> float:
        """ln of the likelihood of what is left (n, 3, L) of each group."""
        return self.volume - 0.5 * float(self.gram([v[None] for v in left])[0, 0])

    def without_misses(self, left: Values) -> list[np.ndarray]:
        """What is left (n, 3, L) of each group without the likeliest misses."""
        return [w.without_misses(v) for w, v in zip(self._each, left, strict=True)]


@dataclass(frozen=True)
class Differences:
    """`size`: by which share of |H| hits differ in the course of their force, more than by chance.

    `chance` is that of so much, were levels exchangeable; 1 where no order could tell.
    """

    size: float
    chance: float


def differences(weighing: Weighing, left: Values) -> Differences:
    """Of hits in groups of three or more: those of a linear robot follow no course with the force.

    Nothing is assumed of how large misses are, but that hits of any force miss alike.
    """
    rng = np.random.default_rng(0)
    even = [_evenly_noisy(g, v, rng) for g, v in zip(weighing.groups, left, strict=True)]
    courses, power, told = 0.0, 0.0, np.zeros(1 + DRAWS)
    for g, off in zip(weighing.groups, weighing.without_misses(even), strict=True):
        power += float(np.sum(np.abs(g.accelerance) ** 2))
        n, course = len(off), np.log(g.peak_n) - np.log(g.peak_n).mean()
        if n < 3:
            continue
        course = course / np.linalg.norm(course)
        along = float(np.sum(np.abs(np.tensordot(course, off, 1)) ** 2))
        courses += ((n - 1) * along - float(np.sum(np.abs(off) ** 2))) / (n - 2)
        flat = (off / g.size).reshape(n, -1).view(float)
        gram = flat @ flat.T
        orders = rng.permuted(np.tile(np.arange(n), (DRAWS, 1)), axis=1)
        each = np.concatenate([course[None], course[orders]])
        share = np.einsum("di,ij,dj->d", each, gram, each) / np.trace(gram)
        told -= n / 2 * np.log(np.maximum(1 - share, 1e-12))
    chance = (1 + np.count_nonzero(told[1:] >= told[0] - 1e-9)) / (1 + DRAWS)
    return Differences(float(np.sqrt(max(courses, 0.0) / max(power, 1e-300))), float(chance))


def _evenly_noisy(g: HitGroup, left: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """With as much noise in each hit as the noisiest has: soft hits are noisier."""
    lacking = np.sqrt((g.variance.max(axis=0) - g.variance) / 2)
    real, imaginary = rng.standard_normal((2, *left.shape))
    return left + lacking * (real + 1j * imaginary)


def share_of(groups: Sequence[HitGroup], changes: Values) -> float:
    """By which share of |H| hits of a group differ by changes (n, 3, L)."""
    off = sum(float(np.sum(np.abs(c - c.mean(axis=0)) ** 2)) for c in changes)
    whole = sum(float(np.sum(np.abs(g.accelerance) ** 2)) for g in groups)
    return float(np.sqrt(off / whole))
