"""In which world cases happen: a clean laboratory, or the cells that there are."""

from dataclasses import dataclass

from planner.truth.deviation import Deviation
from planner.truth.handling import EVERYDAY, LABORATORY, Handling


@dataclass(frozen=True)
class World:
    """How hits and chain err, how robots scatter, and how large effects are.

    `sizes`: the log-uniform range of effects' sizes, 1 being large; each is drawn once. None: all
    are large, and drawn again until they show clearly.
    """

    handling: Handling
    scatter: Deviation
    sizes: tuple[float, float] | None = None
    oversampling: int = 16


CLEAN = World(LABORATORY, Deviation(stiffness=0.15, damping=0.15, inertia=0.04, com_m=0.005))
REAL = World(
    EVERYDAY,
    Deviation(stiffness=0.15, damping=0.4, inertia=0.08, com_m=0.01),
    sizes=(1e-3, 1.0),
    oversampling=8,
)
