"""Sets of effects that were fitted to the same FRFs: which are likely, and which is likeliest."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from planner.effects.effect import Operator
from planner.fit.fitted import StructureFit
from planner.inference.log_space import shares

RARE = 5.0  # nats: one effect at one place, of some 70, is so much rarer than none

# Effects and their places, one of them as often as it is there.
Key = tuple[tuple[str, str], ...]


@dataclass(frozen=True, eq=False)
class ExploredStructures:
    """The robot as it is known to be built, and every set of effects that was settled."""

    plain: StructureFit
    settled: tuple[StructureFit, ...]


def key_of(found: StructureFit) -> Key:
    """What it consists of."""
    return key(added(found))


def key(effects: Iterable[Operator]) -> Key:
    """Of so many effects."""
    return tuple(sorted(e.name for e in effects))


def added(found: StructureFit) -> tuple[Operator, ...]:
    """Effects beside those that every robot has."""
    there = {e.label for e in found.structure.prior.built}
    return tuple(e for e in found.structure.effects if e.label not in there)


def built(found: StructureFit) -> tuple[Operator, ...]:
    """Those that every robot has."""
    there = {e.label for e in found.structure.prior.built}
    return tuple(e for e in found.structure.effects if e.label in there)


def probabilities(fits: Iterable[StructureFit]) -> dict[Key, float]:
    """Probability of each set of effects, among all that were settled."""
    logs = {key_of(f): log_probability(f) for f in fits}
    found = shares(np.array(list(logs.values())), 0)
    return dict(zip(logs, map(float, found), strict=True))


def most_probable(fits: Iterable[StructureFit]) -> StructureFit:
    """Of the likeliest set of effects."""
    return max(fits, key=log_probability)


def log_probability(found: StructureFit) -> float:
    """Logarithm of how likely it is: its evidence, and how rare so many effects are."""
    return found.evidence - RARE * len(added(found))
