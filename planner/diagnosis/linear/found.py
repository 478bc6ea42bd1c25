"""What a search found: fits on the finest lines, and those that it left on the way."""

from dataclasses import dataclass

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.fit import Fit


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
