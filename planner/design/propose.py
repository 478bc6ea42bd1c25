"""From acquisition to proposals: scores on reachable candidates, one pose after another."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from planner.design.acquisitions import (
    goal,
    integrated_variance,
    mixed,
    mutual_information,
    parameter_information,
    parameter_variance,
    stability,
    variance,
)
from planner.design.cost import Cost, best_axes, shortest_tour
from planner.design.frequency_posterior import ALL_AXES, FrequencyOutputs, Poses, Target
from planner.design.space_filling import DESIGNS
from planner.dynamics.vibration import SimulatedModes
from planner.errors import InputError
from planner.surrogate.modal_surrogate import Surrogate

Score = Callable[[FrequencyOutputs, Poses], np.ndarray]

ACQUISITIONS: dict[str, Score] = {
    "variance": variance,
    "integrated_variance": integrated_variance,
    "mutual_information": mutual_information,
    "parameter_information": parameter_variance,
    "d_information": parameter_information,
    "mixed": mixed,
    "goal": goal,
    "stability": stability,
}
# What these look at is nothing where no parameter of the simulation is open.
OF_PARAMETERS = ("parameter_information", "d_information")
INFORMED = (*OF_PARAMETERS, "mixed", "goal", "stability")  # those that look at parameters at all
WORKSPACE_POSES = 200  # candidates (a Sobol prefix: evenly spread) that stand for the workspace
LEAST_DISTANCE = 1e-3  # in model coordinates, to poses measured or proposed before


@dataclass(frozen=True)
class Pick:
    """A chosen candidate, its score (NaN for designs, which have none), minutes, hit axes."""

    index: int
    score: float
    minutes: float = float("nan")
    axes: tuple[int, ...] = ALL_AXES


@dataclass(frozen=True, eq=False)
class Travel:
    """What measuring costs: candidates q (n, dof) in rad, where the robot stands (dof,) or None.

    With `shares` (n, k, 3) of `axis_shares` the axes to hit are chosen as well.
    """

    cost: Cost
    q: np.ndarray
    at: np.ndarray | None = None
    shares: np.ndarray | None = None

    def among(self, which: np.ndarray) -> "Travel":
        """The same for some of the candidates."""
        shares = None if self.shares is None else self.shares[which]
        return replace(self, q=self.q[which], shares=shares)


# In words, for who chooses one.
DESCRIPTIONS = {
    "variance": "the pose whose frequencies are least sure",
    "integrated_variance": "the pose that makes all of the workspace surest",
    "mutual_information": "the pose that tells most of all the others",
    "parameter_information": "the pose that makes predictions surest by what parameters leave open",
    "d_information": "the pose that tells most of the simulation's parameters themselves",
    "mixed": "the pose that makes the workspace surest by frequencies and parameters together",
    "goal": "the pose that makes those of [goal] surest",
    "stability": "the pose that tells most of whether the cut of [cut] is stable",
    "random": "poses at random, without looking at the model",
    "sobol": "poses spread evenly by a Sobol sequence, without looking at the model",
    "maximin_lhs": "poses spread by a maximin Latin hypercube, without looking at the model",
}


def check_name(name: str, where: str = "") -> None:
    """InputError if no acquisition has this name, which stands `where` (file and entry)."""
    if name not in ACQUISITIONS and name not in DESIGNS:
        known = ", ".join([*ACQUISITIONS, *DESIGNS])
        said = f"{where}: there" if where else "There"
        raise InputError(f'{said} is no acquisition "{name}"; choose one of {known}.')


def workspace_outputs(
    surrogate: Surrogate, x: np.ndarray, simulated: SimulatedModes
) -> tuple[FrequencyOutputs, Poses]:
    """Posterior over the first candidates, which stand for the workspace; all as poses."""
    poses = Poses.plain(x, surrogate.frequency_inputs(simulated))
    return FrequencyOutputs.of(surrogate, Target.evenly(poses[:WORKSPACE_POSES])), poses


def propose(
    name: str,
    surrogate: Surrogate,
    x: np.ndarray,
    simulated: SimulatedModes,
    count: int,
    exclude: np.ndarray | None,
    seed: int,
    outlook: tuple[FrequencyOutputs, Poses] | None = None,
    travel: Travel | None = None,
    allowed: np.ndarray | None = None,
) -> tuple[Pick, ...]:
    """Up to `count` picks among candidates x (n, d); the same for the same arguments.

    `exclude` (t, d) are poses measured or refused: candidates at the same place are left out, as
    are those not `allowed` (n,). With `outlook` the simulation's open parameters are seen too;
    with `travel` the best gain per minute is chosen, and several picks make a short tour.
    """
    check_name(name)
    taken = np.zeros((0, x.shape[1])) if exclude is None else exclude
    distance = np.min(np.linalg.norm(x[:, None] - taken[None], axis=2), axis=1, initial=np.inf)
    free = np.flatnonzero((distance > LEAST_DISTANCE) & (True if allowed is None else allowed))
    if not free.size:
        return ()
    if name in DESIGNS:
        picks = free[DESIGNS[name](x[free], taken, count, seed)]
        return tuple(Pick(int(i), float("nan")) for i in picks)
    outputs, poses = outlook or workspace_outputs(surrogate, x, simulated)
    if name in OF_PARAMETERS and not len(outputs.covariance_root):
        name = "integrated_variance"
    picks = _one_after_another(ACQUISITIONS[name], outputs, poses, count, free, travel)
    return _toured(picks, travel)


def _one_after_another(
    score: Score,
    outputs: FrequencyOutputs,
    poses: Poses,
    count: int,
    free: np.ndarray,
    travel: Travel | None,
) -> tuple[Pick, ...]:
    picks: list[Pick] = []
    at = None if travel is None else travel.at
    while len(picks) < count and free.size:
        gain = score(outputs, poses[free])
        minutes = np.full(len(free), np.nan)
        rate = gain
        if travel is not None:
            minutes = travel.cost.minutes(travel.q[free], at, ALL_AXES)
            rate = gain / minutes
        best = int(np.argmax(rate))  # the first of equals
        index, axes, spent = int(free[best]), ALL_AXES, float(minutes[best])
        if travel is not None and travel.shares is not None:
            there = float(travel.cost.travel(travel.q[[index]], at)[0])
            axes = best_axes(outputs, poses.one(index), travel.shares[index], travel.cost, there)
            spent = there + travel.cost.per_pose + travel.cost.hitting(axes)
        picks.append(Pick(index, float(gain[best]), spent, axes))
        at = None if travel is None else travel.q[index]
        outputs = outputs.planning(poses.one(index), axes)
        free = free[np.linalg.norm(poses.x[free] - poses.x[index], axis=1) > LEAST_DISTANCE]
    return tuple(picks)


def _toured(picks: tuple[Pick, ...], travel: Travel | None) -> tuple[Pick, ...]:
    """The same picks in the order of a short tour from where the robot stands."""
    if travel is None or len(picks) < 3:
        return picks
    q = travel.q[[p.index for p in picks]]
    order, legs = shortest_tour(travel.cost, q, travel.at)
    spent = [travel.cost.per_pose + travel.cost.hitting(picks[i].axes) for i in order]
    return tuple(
        replace(picks[i], minutes=float(leg + own))
        for i, leg, own in zip(order, legs, spent, strict=True)
    )
