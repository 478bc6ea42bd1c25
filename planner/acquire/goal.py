"""Goal: the candidate that lowers the variance of what matters most.

What matters is a path of poses, labels with weights of their own, or modes within a band, as
`outputs.goal` says; the variance is that of `mixed`.
"""

import numpy as np

from planner.acquire.outputs import FrequencyOutputs, Poses
from planner.acquire.parameter_information import parameter_reduction
from planner.acquire.reduction import reduction


def goal(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Expected reduction (n,) of the mean relative frequency variance over the goal."""
    return reduction(outputs, poses, outputs.goal) + parameter_reduction(
        outputs, poses, outputs.goal
    )
