"""How much each visit's chain was another than at the other visits, by evidence.

A sensor that is seated again, another hammer tip, a wrong sensitivity: what one visit has for
itself is a multiple of `Tolerances.visit_chain`, inferred visit by visit as the discrepancy's size
is of all.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from planner.fit.fitted import StructureFit

# Multiples that are looked at: up to gains some tens of percent off, and sensors 10 cm elsewhere.
# Few visits are far from 1.
MULTIPLES = (1.0, 4.0, 16.0, 64.0, 256.0)
SPREAD = 1.5  # sd of the logarithm
STRAINED = 4.0  # sds
LEAST_VISITS = 3  # of two nobody knows whose chain is off


@dataclass(frozen=True, eq=False)
class _Visit:
    """One visit's part of the normal equations, own numbers eliminated; their volume."""

    schur: np.ndarray  # (D + 1, D + 1)
    volume: float


def likeliest_multiples(found: StructureFit) -> tuple[float, ...]:
    """Of each visit, where all numbers follow to first order; uphill from the present ones."""
    visits, levels = _Visits(found), [*map(MULTIPLES.index, _present(found))]
    best = visits.evidence(levels)
    for _ in MULTIPLES:
        before = best
        for k, level in enumerate(levels):
            for near in (level - 1, level + 1):
                tried = [*levels[:k], near, *levels[k + 1 :]]
                if 0 <= near < len(MULTIPLES) and (value := visits.evidence(tried)) > best:
                    best, levels = value, tried
        if best == before:
            break
    return tuple(MULTIPLES[k] for k in levels)


def other_chain(found: StructureFit, visit: int) -> tuple[float, float, float]:
    """How many times as large a visit's accelerations were as at the others, for the same forces;
    and by how many rad its first sensor was turned, and by how many m moved."""
    t, misfit = found.misfit.tolerances, found.misfit
    shares = t.visit_chain * misfit.seated_shares(_present(found)[visit])[0]
    own = shares * found.at.own[visit, misfit.seated.start + 1 :]
    matrix = np.eye(3) + np.where(np.eye(3), t.gain, t.across) * own[:9].reshape(3, 3)
    left, sizes, right = np.linalg.svd(matrix * (1 + t.force_gain * own[-1]))
    turn = np.arccos(np.clip((np.trace(left @ right) - 1) / 2, -1, 1))
    moved = t.position_m * float(np.linalg.norm(own[9:12]))
    return float(np.exp(np.mean(np.log(sizes)))), float(turn), moved


def strained(found: StructureFit) -> bool:
    """Whether what a visit's chain has for itself is more than its tolerances let expect."""
    own = found.at.own[:, found.misfit.seated.start + 1 :]
    return bool(np.max(np.abs(own)) > STRAINED)


def _present(found: StructureFit) -> list[float]:
    multiples = found.misfit.data.multiples
    return np.broadcast_to(multiples, len(found.misfit.data.q)).tolist()


class _Visits:
    """All visits of a fit, each by any multiple."""

    def __init__(self, found: StructureFit) -> None:
        misfit, self.structure, self.x = found.misfit, found.structure, found.at.x
        white = misfit.whitened(misfit.around(found.at.x, found.at.own).columns)
        self.gram, self.misfit = white @ np.swapaxes(white, 1, 2), misfit
        self.present = _present(found)
        self.visit = cache(self._visit)
        _, self.pull, self.curvature = self.structure.bodies.barrier(
            self.x[self.structure.inertial]
        )

    def _visit(self, k: int, level: int) -> _Visit:
        d, gram = self.structure.size, self.gram[k].copy()
        now, then = self.misfit.seated_shares(np.array([self.present[k], MULTIPLES[level]]))
        gram[self.misfit.seated] *= (then / now)[:, None]
        gram[:, self.misfit.seated] *= then / now
        own = gram[d:-1, d:-1]
        factor = np.linalg.cholesky(own + np.eye(len(own)))
        kept = [*range(d), -1]
        onto = np.linalg.solve(factor, gram[d:-1, kept])
        volume = 2 * float(np.sum(np.log(np.diagonal(factor))))
        return _Visit(gram[np.ix_(kept, kept)] - onto.T @ onto, volume)

    def evidence(self, levels: list[int]) -> float:
        """As `FrfMisfit.evidence` where one more step would end, but for what is common to all."""
        s, each = self.structure, [self.visit(k, level) for k, level in enumerate(levels)]
        whole = np.sum([one.schur for one in each], axis=0)
        normal, slope = whole[:-1, :-1] + s.precision, whole[:-1, -1]
        normal[s.inertial, s.inertial] += self.curvature
        away = self.x - s.mean
        downhill = slope + s.precision @ away
        downhill[s.inertial] += self.pull
        factor = np.linalg.cholesky(normal)
        spent = 2 * float(np.sum(np.log(np.diagonal(factor))))
        gained = float(np.sum(np.linalg.solve(factor, downhill) ** 2))
        chi2 = float(whole[-1, -1] + away @ s.precision @ away)
        rare = float(np.sum((np.log([MULTIPLES[k] for k in levels]) / SPREAD) ** 2))
        volume = sum(one.volume for one in each)
        return -0.5 * (chi2 + volume + spent + rare - gained)
