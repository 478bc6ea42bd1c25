"""From acquisition to proposals: scores on reachable candidates, one pose after another."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.acquire import space_filling
from planner.acquire.integrated_variance import integrated_variance
from planner.acquire.outputs import FrequencyOutputs
from planner.acquire.variance import variance
from planner.errors import InputError
from planner.fusion.surrogate import Surrogate
from planner.physics.dynamics import SimulatedModes

Score = Callable[[FrequencyOutputs, np.ndarray, np.ndarray], np.ndarray]
Design = Callable[[np.ndarray, np.ndarray, int, int], np.ndarray]

ACQUISITIONS: dict[str, Score] = {
    "variance": variance,
    "integrated_variance": integrated_variance,
}
DESIGNS: dict[str, Design] = {
    "random": space_filling.random,
    "sobol": space_filling.sobol,
    "maximin_lhs": space_filling.maximin_lhs,
}
INTEGRATION = 200  # candidates (a Sobol prefix: evenly spread) that stand for the workspace
NEAR = 1e-3  # in model coordinates: no second measurement at the same place


@dataclass(frozen=True)
class Pick:
    """A chosen candidate and its score (NaN for designs, which have none)."""

    index: int
    score: float


def check_name(name: str) -> None:
    """InputError if no acquisition has this name."""
    if name not in ACQUISITIONS and name not in DESIGNS:
        known = ", ".join([*ACQUISITIONS, *DESIGNS])
        raise InputError(f'There is no acquisition "{name}"; choose one of {known}.')


def propose(
    name: str,
    surrogate: Surrogate,
    x: np.ndarray,
    simulated: SimulatedModes,
    count: int,
    exclude: np.ndarray | None,
    seed: int,
) -> tuple[Pick, ...]:
    """Up to `count` picks among candidates x (n, d); the same for the same arguments.

    `exclude` (t, d) are poses measured or refused: candidates at the same place are left out.
    """
    check_name(name)
    taken = np.zeros((0, x.shape[1])) if exclude is None else exclude
    distance = np.min(np.linalg.norm(x[:, None] - taken[None], axis=2), axis=1, initial=np.inf)
    free = np.flatnonzero(distance > NEAR)
    if not free.size:
        return ()
    if name in DESIGNS:
        picks = free[DESIGNS[name](x[free], taken, count, seed)]
        return tuple(Pick(int(i), float("nan")) for i in picks)
    return _one_after_another(ACQUISITIONS[name], surrogate, x, simulated, count, free)


def _one_after_another(
    score: Score,
    surrogate: Surrogate,
    x: np.ndarray,
    simulated: SimulatedModes,
    count: int,
    free: np.ndarray,
) -> tuple[Pick, ...]:
    low = surrogate.frequency_inputs(simulated)
    outputs = FrequencyOutputs.of(surrogate, x[:INTEGRATION], low[:INTEGRATION])
    picks: list[Pick] = []
    while len(picks) < count and free.size:
        scores = score(outputs, x[free], low[free])
        best = int(np.argmax(scores))  # the first of equals
        picks.append(Pick(int(free[best]), float(scores[best])))
        outputs = outputs.planning(x[free[best]], low[free[best]])
        free = free[np.linalg.norm(x[free] - x[free[best]], axis=1) > NEAR]
    return tuple(picks)
