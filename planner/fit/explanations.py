"""Sets of effects that were fitted to the same FRFs: which are likely, and which is likeliest."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from planner.effects.effect import Operator
from planner.fit.fitted import StructureFit
from planner.inference.log_space import shares

RARE = 5.0  # nats: one effect at one place, of some 70, is so much rarer than none
UNLIKE = 1e12  # squared sds apart of what is called otherwise

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


def matched(
    fit: StructureFit, other: StructureFit, effects: Sequence[Operator]
) -> list[tuple[Operator, Operator]]:
    """What was added to a fit, each with that of another's `effects` which is called the same and
    fewest sds away: a link may carry several hoses."""
    from scipy.optimize import linear_sum_assignment  # not needed between hits

    mine, theirs = added(fit), dict(zip(other.structure.effects, other.structure.own, strict=True))
    own = dict(zip(fit.structure.effects, fit.structure.own, strict=True))
    apart = np.full((len(mine), len(effects)), UNLIKE)
    for k, f in enumerate(effects):
        known = np.linalg.inv(other.at.covariance[theirs[f], theirs[f]])
        for i in (i for i, e in enumerate(mine) if e.name == f.name):
            away = fit.at.x[own[mine[i]]] - other.at.x[theirs[f]]
            apart[i, k] = min(float(away @ known @ away), UNLIKE)
    pairs = zip(*linear_sum_assignment(apart), strict=True)
    return [(mine[i], effects[k]) for i, k in pairs]


def gone(fewer: StructureFit, fit: StructureFit) -> list[Operator]:
    """What of the effects added to a fit is not in another that has fewer."""
    kept = [there for _, there in matched(fewer, fit, added(fit))]
    return [effect for effect in added(fit) if effect not in kept]
