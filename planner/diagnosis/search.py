"""Which effects explain the recordings: all compete at all places, one more at a time.

Where little is left, few steps from the fit so far tell them apart; where much is, each is fitted
from afar by logarithms first. What is settled is kept: the posterior is over all of it.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from planner.effects.effect import Operator
from planner.fit.fitted import (
    StructureFit,
    converged,
    evidence_of,
    removal_costs,
    settled,
    without,
)
from planner.fit.search import Search
from planner.fit.structure import RobotStructure

FITTED, SCREENED = 24, 48  # lines a pose
RARE = 5.0  # nats: one effect at one place, of some 70, is so much rarer than none
LEAST = RARE + float(np.log(9.0))  # nats that one more effect must gain: it is 9 times as likely
SETTLED = 4  # of those that compete
ROUNDS, FROM_AFAR = 4, 2

Key = frozenset[tuple[str, str]]


def key_of(found: StructureFit) -> Key:
    """What it consists of."""
    return frozenset(e.name for e in added(found))


def added(found: StructureFit) -> tuple[Operator, ...]:
    """Effects beside those that every robot has."""
    there = {e.label for e in built(found)}
    return tuple(e for e in found.structure.effects if e.label not in there)


def built(found: StructureFit) -> tuple[Operator, ...]:
    """Those that every robot has."""
    there = {e.label for e in found.structure.prior.repertoire.as_built()}
    return tuple(e for e in found.structure.effects if e.label in there)


@dataclass(frozen=True, eq=False)
class Explored:
    """The robot as stated, the likeliest explanation, and everything that was settled."""

    plain: StructureFit
    best: StructureFit
    settled: tuple[StructureFit, ...]


@dataclass(frozen=True, eq=False)
class Explorer:
    """Explains FRFs by the effects of a search's repertoire."""

    search: Search

    def explored(self) -> Explored:
        """From the robot as stated on."""
        search = self.search
        data = search.data(FITTED)
        built = search.prior.repertoire.as_built()
        stated = RobotStructure(search.prior, built, data.sensors)
        plain = best = converged(search.begun(data, stated))
        pool: dict[Key, StructureFit] = {key_of(plain): plain}
        for number in range(ROUNDS):
            ends = self._further(best, afar=number < FROM_AFAR)
            _keep(pool, ends)
            if not ends or ends[0].evidence < best.evidence + LEAST:
                break
            search.tell(f"+ {ends[0].structure.effects[-1].label}")
            before, best = best, self._pruned(converged(ends[0]), pool)
            _keep(pool, [best])
            if _change(before, best) < search.floor:
                break  # what is smaller yet does not matter
        best = self._exchanged(best, pool)
        return Explored(plain, best, tuple(pool.values()))

    def _exchanged(self, best: StructureFit, pool: dict[Key, StructureFit]) -> StructureFit:
        """Each effect at other places, and each of several against all others in its place."""
        for effect in added(best):
            if effect not in best.structure.effects:
                continue
            ends = self.search.displaced(best, effect)
            if len(added(best)) > 1:
                fewer = self._fewer(best, effect)
                _keep(pool, [fewer])
                ends += self._further(fewer)
            _keep(pool, ends)
            likeliest = max(ends, key=evidence_of, default=best)
            if likeliest.evidence > best.evidence + LEAST / 4:
                self.search.tell(f"{effect.label} → {likeliest.structure.effects[-1].label}")
                best = self._pruned(converged(likeliest), pool)
                _keep(pool, [best])
        return best

    def _pruned(self, best: StructureFit, pool: dict[Key, StructureFit]) -> StructureFit:
        """Without what the others make superfluous."""
        costs = removal_costs(best)
        for effect in sorted(added(best)[:-1], key=lambda e: costs[e]):
            fewer = self._fewer(best, effect)
            _keep(pool, [fewer])
            if fewer.evidence > best.evidence - LEAST / 2:
                self.search.tell(f"− {effect.label}")
                best = fewer
        return best

    def _fewer(self, best: StructureFit, effect: Operator) -> StructureFit:
        """Without an effect: from where it is, and from what is stated, lest that be bent."""
        structure, search = best.structure.without(effect), self.search
        x, own = structure.mean.copy(), slice(structure.inertial.stop, structure.chain.start)
        x[own] = structure.carried(best.structure, best.at.x)[own]  # the other effects' numbers
        if not replace(best.misfit, structure=structure).possible(x):
            x = structure.mean
        ends = [converged(search.begun(best.misfit.data, structure, x))]
        near = without(best, [effect])
        ends += [] if near is None else [settled(near.misfit, near.at)]
        return max(ends, key=evidence_of)

    def _further(self, base: StructureFit, afar: bool = False) -> list[StructureFit]:
        """With one effect more, settled, likeliest first."""
        starts = self.search.starts(base, SCREENED)
        return self.search.compete(base, starts, count=SETTLED, unmoved=False, afar=afar)


def _change(before: StructureFit, after: StructureFit) -> float:
    """By how much of |H| at the measured poses both differ."""
    one, other = (np.abs(f.at.motion.accelerance) for f in (before, after))
    return float(np.linalg.norm(other - one) / np.linalg.norm(other))


def _keep(pool: dict[Key, StructureFit], more: Iterable[StructureFit]) -> None:
    for one in more:
        known = pool.get(key_of(one))
        if known is None or one.evidence > known.evidence:
            pool[key_of(one)] = one
