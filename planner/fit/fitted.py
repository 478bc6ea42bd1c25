"""A structure fitted to FRFs: its discrepancy by evidence, and what its effects are worth."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.effects.effect import Operator
from planner.fit.gauss_newton import minimised
from planner.fit.linearised import At
from planner.fit.misfit import FrfMisfit
from planner.fit.structure import RobotStructure

SIZES = (0.004, 0.008, 0.015, 0.03, 0.06, 0.12, 0.3)  # of the discrepancy: no robot is linear
USUAL, SPREAD = 0.02, 1.5  # its prior: log-normal
SETTLED = 8  # steps
RESTED = 1.0  # nats that a step may still promise


@dataclass(frozen=True, eq=False)
class StructureFit:
    """A structure fitted to FRFs; `wider` has beside it what they cannot exclude."""

    misfit: FrfMisfit
    at: At
    evidence: float
    wider: "StructureFit | None" = None

    @cached_property
    def shares(self) -> tuple[float, ...]:
        """By how much of |H| at the measured poses each effect's going changes the best fit."""
        return tuple(self.share_of([effect]) for effect in self.structure.effects)

    def share_of(self, effects: Sequence[Operator]) -> float:
        """The same of several that go together."""
        h, fewer = self.at.motion.accelerance, without(self, effects)
        gone = 0.0 * h if fewer is None else fewer.at.motion.accelerance
        return float(np.linalg.norm(gone - h) / np.linalg.norm(h))

    @property
    def remembered(self) -> "FitRecord":
        """What is worth keeping of it."""
        record = self._record(self.shares)
        return replace(record, wider=self.wider._record(()) if self.wider else None)

    @property
    def tried(self) -> "Tried":
        """What another process needs of it."""
        return Tried(self._record(()), self.evidence)

    def _record(self, shares: tuple[float, ...]) -> "FitRecord":
        s = self.structure
        found, multiples = self.at, self.misfit.data.multiples
        told = tuple(np.broadcast_to(multiples, len(found.own)).tolist())
        return FitRecord(s.effects, s.names, found.x, found.own, size_of(self), shares, told)

    @property
    def promised(self) -> float:
        """Nats that one more step promises."""
        s, at = self.structure, self.at
        downhill = at.gradient + s.precision @ (at.x - s.mean)
        return 0.5 * float(downhill @ np.linalg.solve(at.normal + s.precision, downhill))

    @property
    def settled(self) -> bool:
        """Whether one more step would gain next to nothing."""
        return self.promised < RESTED

    @property
    def structure(self) -> RobotStructure:
        """Of what it is made."""
        return self.misfit.structure


@dataclass(frozen=True, eq=False)
class FitRecord:
    """A structure's effects, its numbers by name, the discrepancy's size, and what each pose had.

    From it a fit goes on, or is recalled without any step.
    """

    effects: tuple[Operator, ...]
    names: tuple[str, ...]
    x: np.ndarray
    own: np.ndarray
    size: float
    shares: tuple[float, ...]
    multiples: tuple[float, ...]  # of each pose, as in `FrfData`
    wider: "FitRecord | None" = None

    @property
    def labels(self) -> frozenset[str]:
        """Of its effects."""
        return frozenset(e.label for e in self.effects)


@dataclass(frozen=True, eq=False)
class Tried:
    """A fit by its numbers alone, and its evidence."""

    record: FitRecord
    evidence: float


def settled(misfit: FrfMisfit, at: At, rounds: int = 1, steps: int = SETTLED) -> StructureFit:
    """With a discrepancy of the likeliest size, inferred again after each round of steps."""
    misfit, at = sized(misfit, at)
    for _ in range(rounds):
        misfit, at = sized(misfit, minimised(misfit, at.x, steps, own=at.own))
    return StructureFit(misfit, at, misfit.evidence(at) + _of_size(misfit))


def converged(found: StructureFit) -> StructureFit:
    """Fitted on until the evidence stays: half-fitted, any candidate looks useful."""
    for _ in range(5):
        more = settled(found.misfit, found.at, steps=10)
        if more.evidence <= found.evidence + 2:
            return more if more.evidence > found.evidence else found
        found = more
    return found


def sized(misfit: FrfMisfit, at: At) -> tuple[FrfMisfit, At]:
    """With the likeliest size of the discrepancy, uphill from the present one; what is there."""
    around, known = misfit.around(at.x, at.own), {}
    sizes = [s for s in SIZES if s > misfit.floor]
    sizes = [misfit.floor, *sizes] if misfit.floor else sizes

    def worth(k: int) -> float:
        if k not in known:
            one = misfit.with_rho(sizes[k])
            there = one.weighed(around)
            known[k] = one.evidence(there) + _of_size(one), one, there
        return known[k][0]

    k = int(np.argmin(np.abs(np.log(np.array(sizes) / _rho(misfit)))))
    while True:
        near = [j for j in (k - 1, k, k + 1) if 0 <= j < len(sizes)]
        best = max(near, key=worth)
        if best == k:
            return known[k][1], known[k][2]
        k = best


def _of_size(misfit: FrfMisfit) -> float:
    return -0.5 * float((np.log(_rho(misfit) / USUAL) / SPREAD) ** 2)


def _rho(misfit: FrfMisfit) -> float:
    assert misfit.rho is not None
    return misfit.rho


def size_of(found: StructureFit) -> float:
    return _rho(found.misfit)


def explains_all(found: StructureFit) -> bool:
    """Whether as little is left as may be: else an angle stands in for anything that is."""
    return size_of(found) <= SIZES[0]


def evidence_of(found: "StructureFit | Tried") -> float:
    return found.evidence


def stepped(
    misfit: FrfMisfit, x: np.ndarray, steps: int, own: np.ndarray | None = None
) -> StructureFit:
    """After some steps from x, the discrepancy as large as it is."""
    at = minimised(misfit, x, steps, 1.0, own)
    return StructureFit(misfit, at, misfit.evidence(at) + _of_size(misfit))


def removal_costs(found: StructureFit) -> dict[Operator, float]:
    """Nats that each effect's going would cost, all else at its best again, to first order.

    Springs vanish in compliance: their logarithms go by one.
    """
    s = found.structure
    covariance = np.linalg.inv(found.at.normal + s.precision)
    costs = {}
    for effect, own in zip(s.effects, s.own, strict=True):
        change = effect.vanishing(found.at.x[own])
        at = list(range(own.start, own.start + len(change)))
        mine = set(effect.springs)
        springs = [i for i in range(s.stiffnesses) if mine.issuperset(s.parameters[i].blocks)]
        change, at = np.append(change, np.ones(len(springs))), at + springs
        costs[effect] = 0.5 * float(change @ np.linalg.solve(covariance[np.ix_(at, at)], change))
    return costs


def without(best: StructureFit, effects: Sequence[Operator], steps: int = 5) -> StructureFit | None:
    """A few steps from where the others are; None where such a robot can't be."""
    return max(exchanged(best, effects, (), steps), key=evidence_of, default=None)


def exchanged(
    best: StructureFit, left: Sequence[Operator], new: Sequence[Operator], steps: int = 5
) -> Iterator[StructureFit]:
    """With `new` effects in the place of some, a few steps from wherever the last may begin."""
    structure = best.structure
    for effect in left:
        structure = structure.without(effect)
    for effect in new:
        structure = structure.with_effect(effect)
    misfit = replace(best.misfit, structure=structure)
    x = np.maximum(structure.carried(best.structure, best.at.x), structure.least)
    begun = [x]
    for psi in new[-1].beside(new[-1].mean) if new else ():
        begun.append(x.copy())
        begun[-1][structure.own[-1]] = psi
    return (stepped(misfit, one, steps, best.at.own) for one in begun if misfit.possible(one))
