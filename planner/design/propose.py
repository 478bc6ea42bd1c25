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
from planner.design.frequency_posterior import ALL_AXES, FrequencyOutputs, Poses
from planner.design.space_filling import DESIGNS
from planner.errors import InputError

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
    "integrated_variance": "the pose that lowers most the variance over the workspace",
    "mutual_information": "the pose that tells most of all the others",
    "parameter_information": "the pose that lowers most what parameters leave open",
    "d_information": "the pose that tells most of the simulation's parameters themselves",
    "mixed": "the pose that lowers most the variance by frequencies and parameters",
    "goal": "the pose that lowers the variance at those of [goal] most",
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


def propose(
    name: str,
    x: np.ndarray,
    count: int,
    exclude: np.ndarray,
    seed: int,
    outlook: tuple[FrequencyOutputs, Poses] | None,
    travel: Travel,
    allowed: np.ndarray,
) -> tuple[Pick, ...]:
    """Up to `count` picks among candidates x (n, d); the same for the same arguments.

    `exclude` (t, d) are poses measured or refused: candidates at the same place are left out, as
    are those not `allowed` (n,). `outlook` is what the model says of the candidates, of which
    those with the best gain per minute are chosen; several picks make a short tour. DESIGNS look at
    neither.
    """
    check_name(name)
    distance = np.min(np.linalg.norm(x[:, None] - exclude[None], axis=2), axis=1, initial=np.inf)
    free = np.flatnonzero((distance > LEAST_DISTANCE) & allowed)
    if not free.size:
        return ()
    if name in DESIGNS:
        picks = free[DESIGNS[name](x[free], exclude, count, seed)]
        return tuple(Pick(int(i), float("nan")) for i in picks)
    assert outlook is not None
    outputs, poses = outlook
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
    travel: Travel,
) -> tuple[Pick, ...]:
    picks: list[Pick] = []
    at = travel.at
    while len(picks) < count and free.size:
        gain = score(outputs, poses[free])
        minutes = travel.cost.minutes(travel.q[free], at, ALL_AXES)
        best = int(np.argmax(gain / minutes))  # the first of equals
        index, axes, spent = int(free[best]), ALL_AXES, float(minutes[best])
        if travel.shares is not None:
            there = float(travel.cost.travel(travel.q[[index]], at)[0])
            axes = best_axes(outputs, poses[[index]], travel.shares[index], travel.cost, there)
            spent = there + travel.cost.per_pose + travel.cost.hitting(axes)
        picks.append(Pick(index, float(gain[best]), spent, axes))
        at = travel.q[index]
        outputs = outputs.planning(poses[[index]], axes)
        free = free[np.linalg.norm(poses.x[free] - poses.x[index], axis=1) > LEAST_DISTANCE]
    return tuple(picks)


def _toured(picks: tuple[Pick, ...], travel: Travel) -> tuple[Pick, ...]:
    """The same picks in the order of a short tour from where the robot stands."""
    if len(picks) < 3:
        return picks
    q = travel.q[[p.index for p in picks]]
    order, legs = shortest_tour(travel.cost, q, travel.at)
    spent = [travel.cost.per_pose + travel.cost.hitting(picks[i].axes) for i in order]
    return tuple(
        replace(picks[i], minutes=float(leg + own))
        for i, leg, own in zip(order, legs, spent, strict=True)
    )
