"""Which effects explain the recordings: what a search settled, by sets of effects."""

from dataclasses import dataclass, replace

import numpy as np

from planner.effects.effect import Operator
from planner.fit.fitted import StructureFit
from planner.fit.search import Search

RARE = 5.0  # nats: one effect at one place, of some 70, is so much rarer than none
LEAST = RARE + float(np.log(9.0))  # nats that one more effect must gain: it is 9 times as likely

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


def explored(search: Search) -> Explored:
    """Everything that a search settles, the likeliest of each set of effects."""
    pool: dict[Key, StructureFit] = {}

    def keep(one: StructureFit) -> None:
        known = pool.get(key_of(one))
        if known is None or one.evidence > known.evidence:
            pool[key_of(one)] = one

    built = search.prior.repertoire.as_built()
    plain, best = replace(search, built=built, note=keep).explored()
    keep(best)
    return Explored(plain, best, tuple(pool.values()))
