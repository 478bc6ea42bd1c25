"""Goal: the candidate that lowers the variance of what matters most.

What matters is a path of poses, labels with weights of their own, or modes within a band, as
`outputs.goal` says; the variance is that of `mixed`.
"""

import numpy as np

from planner.design.frequency_posterior import FrequencyOutputs, Poses
from planner.design.parameter_information import parameter_reduction
from planner.design.variance_reduction import reduction


def goal(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Expected reduction (n,) of the mean relative frequency variance over the goal."""
    return reduction(outputs, poses, outputs.goal) + parameter_reduction(
        outputs, poses, outputs.goal
    )
