"""In which world cases happen: a clean laboratory, or the cells that there are."""

from dataclasses import dataclass

from planner.truth.deviation import Scatter
from planner.truth.handling import EVERYDAY, LABORATORY, Handling


@dataclass(frozen=True)
class World:
    """How hits and chain err, how robots scatter, and how large effects are.

    `sizes`: the log-uniform range of effects' sizes, 1 being large; each is drawn once. None: all
    are large, and drawn again until they show clearly. `imperfect`: robots have small unlisted
    imperfections everywhere, and effects come in shapes that the planner's models do not have.
    """

    handling: Handling
    scatter: Scatter
    sizes: tuple[float, float] | None = None
    imperfect: bool = False
    oversampling: int = 16


CLEAN = World(LABORATORY, Scatter(0.15, 0.15, 0.04, 0.005))
# Stiffnesses that are off together: see `imperfections.SOFT`.
REAL = World(EVERYDAY, Scatter(0.15, 0.4, 0.08, 0.01, 0.25), (0.03, 1.0), True, 8)
