"""What a search found: fits on the finest lines, and those that it left on the way."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.evidence import lag
from planner.diagnosis.linear.fit import Fit, settle
from planner.diagnosis.linear.problem import CLOSE, Problem


@dataclass(frozen=True, eq=False)
class Found:
    """All fits on the finest lines, "none" first, and how far behind the others were left."""

    finalists: tuple[Fit, ...]
    left: tuple[tuple[Effect, float, Fit], ...]  # log evidence behind the best when it was left


def distinct(found: Found) -> Found:
    """Each set of effects once, at its best, though it was come upon from several sides."""
    best: dict[frozenset[Effect], Fit] = {}
    for f in found.finalists:
        key = frozenset(f.effect.parts())
        if key not in best or f.value < best[key].value:
            best[key] = f
    left = tuple(entry for entry in found.left if frozenset(entry[0].parts()) not in best)
    return Found(tuple(best.values()), left)


def behind(problem: Problem, best: Fit, others: Sequence[Fit], temper: float) -> list[float]:
    """Tempered log evidence (nats) by which others, not fitted to the end, are behind the best.

    As `lag` says where they were looked at closely; of rough looks χ² alone is compared.
    """
    if not others:
        return []
    near, half = settle(problem, best, CLOSE, 2), float(best.misfit.counts.sum()) / (2 * temper)
    return [
        float(lag([near, other])[1])
        if np.array_equal(other.misfit.counts, near.misfit.counts)
        else half * (other.per_value - best.per_value)
        for other in others
    ]
