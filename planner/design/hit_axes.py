"""Along which axes to hit: fewer axes save minutes where they give enough information.

In white noise the information about a mode's frequency grows with the square of its peaks: a hit
along axis j gives the share |R_j|² / Σ |R_j|² of what hits along all axes give, R_j being the
column of its residue matrix. A measurement's variance is that much larger (heteroscedastic noise).
"""

import numpy as np

from planner.design.cost import Cost
from planner.design.frequency_posterior import ALL_AXES, AXES, FrequencyOutputs, Poses
from planner.design.reductions import SUBSETS, Axes, parameter_reduction, reduction_by_label

LEAST_SHARE = 0.05  # of a mode's information: below it the mode may not be found at all


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
) -> tuple[Axes, float]:
    """The axes with the best gain per minute at a pose (n = 1), and the gain of hitting them.

    `shares` (k, 3) as in `axis_shares`; `travel` are the minutes to get there. Sets of axes that
    do not show every mode that counts are left out; all axes always may be hit.
    """
    each, variance = reduction_by_label(outputs, pose, outputs.workspace)
    counts = outputs.weights > 0
    best, gain, rate = ALL_AXES, 0.0, -np.inf
    for axes in SUBSETS:
        seen = shares[:, list(axes)].sum(axis=1)
        if axes != ALL_AXES and np.any(seen[counts] < LEAST_SHARE):
            continue
        # The EMA's own part of the noise grows; the nugget, which is the pose's, stays.
        more = outputs.measurement * (1 / np.maximum(seen, 1e-9) - 1)
        reduced = float(np.sum(each[:, 0] * variance[:, 0] / (variance[:, 0] + more)))
        reduced += parameter_reduction(outputs, pose, outputs.workspace, axes)[0]
        minutes = travel + cost.per_pose + cost.hitting(axes)
        if reduced / minutes > rate:
            best, gain, rate = axes, reduced, reduced / minutes
    return best, gain
