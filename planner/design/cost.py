"""What measuring a pose costs in minutes: travel at the joints' speeds, and every hit.

Fewer hit axes save minutes where they give enough information. In white noise that about a mode's
frequency grows with the square of its peaks: a hit along axis j gives the share |R_j|² / Σ |R_j|²
of what hits along all axes give, R_j being the column of its residue matrix. A measurement's
variance is that much larger (heteroscedastic noise).
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from planner.design.acquisitions import SUBSETS, Axes, parameter_reduction, reduction_by_label
from planner.design.frequency_posterior import (
    ALL_AXES,
    AXES,
    MEASUREMENT_SD,
    FrequencyOutputs,
    Poses,
)

LEAST_SHARE = 0.05  # of a mode's information: below it the mode may not be found at all


@dataclass(frozen=True, eq=False)
class Cost:
    """Joint speeds (dof,) in rad/s (slides: m/s) at which the robot moves to poses, and minutes.

    `per_pose` is for brakes, settling and the analyser; `per_hit` for one hit, of which there are
    `hits_per_axis` along each axis; `per_sensor` for putting up one more sensor.
    """

    speed_rad_s: np.ndarray
    per_pose: float = 1.0
    per_hit: float = 0.25
    hits_per_axis: int = 4
    per_sensor: float = 3.0

    def travel(self, q: np.ndarray, start: np.ndarray | None) -> np.ndarray:
        """Minutes (n,) from `start` (dof,) to q (n, dof), all joints at once; 0 from nowhere."""
        if start is None:
            return np.zeros(len(q))
        return np.max(np.abs(q - start) / self.speed_rad_s, axis=1) / 60

    def minutes(self, q: np.ndarray, start: np.ndarray | None, axes: tuple[int, ...]) -> np.ndarray:
        """Minutes (n,) for travelling to q (n, dof) and hitting along `axes` there."""
        return self.travel(q, start) + self.per_pose + self.hitting(axes)

    def hitting(self, axes: tuple[int, ...]) -> float:
        """Minutes for hitting along `axes`."""
        return self.per_hit * self.hits_per_axis * len(axes)


def shortest_tour(
    cost: Cost, q: np.ndarray, start: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """A short order (n,) of visiting q (n, dof) from `start`, and the minutes (n,) of each leg.

    Nearest neighbour, then two-opt (Croes 1958) until nothing is gained; the tour does not return.
    """
    n = len(q)
    apart = np.array([cost.travel(q, one) for one in q])
    first = cost.travel(q, start)

    def length(order: list[int]) -> float:
        legs = [apart[a, b] for a, b in pairwise(order)]
        return float(first[order[0]] + sum(legs))

    order: list[int] = [int(np.argmin(first))]
    while len(order) < n:
        left = [i for i in range(n) if i not in order]
        order.append(min(left, key=lambda i: apart[order[-1], i]))
    improved = True
    while improved:
        improved = False
        for i in range(n - 1):
            for j in range(i + 1, n):
                other = order[:i] + order[i : j + 1][::-1] + order[j + 1 :]
                if length(other) < length(order) - 1e-12:
                    order, improved = other, True
    legs = [first[order[0]], *(apart[a, b] for a, b in pairwise(order))]
    return np.array(order), np.array(legs)


def axis_shares(residue: np.ndarray) -> np.ndarray:
    """Share (n, k, 3) of the information about each mode, by hit axis; residue (n, k, 3, 3).

    A third each where the simulation has no such mode.
    """
    square = np.sum(np.abs(residue) ** 2, axis=2)
    total = square.sum(axis=2, keepdims=True)
    known = np.isfinite(total) & (total > 0)
    return np.where(known, square / np.where(known, total, 1.0), 1 / AXES)


def best_axes(
    outputs: FrequencyOutputs, pose: Poses, shares: np.ndarray, cost: Cost, travel: float
) -> Axes:
    """The axes with the best gain per minute at a pose (n = 1).

    `shares` (k, 3) as in `axis_shares`; `travel` are the minutes to get there. Sets of axes that
    do not show every mode that counts are left out; all axes always may be hit.
    """
    each, variance = reduction_by_label(outputs, pose, outputs.workspace)
    counts = outputs.weights > 0
    best, rate = ALL_AXES, -np.inf
    for axes in SUBSETS:
        seen = shares[:, list(axes)].sum(axis=1)
        if axes != ALL_AXES and np.any(seen[counts] < LEAST_SHARE):
            continue
        # The EMA's own part of the noise grows; the nugget, which is the pose's, stays.
        more = MEASUREMENT_SD**2 * (1 / np.maximum(seen, 1e-9) - 1)
        reduced = float(np.sum(each[:, 0] * variance[:, 0] / (variance[:, 0] + more)))
        reduced += parameter_reduction(outputs, pose, outputs.workspace, axes)[0]
        minutes = travel + cost.per_pose + cost.hitting(axes)
        if reduced / minutes > rate:
            best, rate = axes, reduced / minutes
    return best
