"""Integrated variance: the candidate whose measurement lowers the variance over the workspace most.

(Sacks et al. 1989; Cohn 1996; see `reduction`.) What the simulation's parameters leave open is
not looked at; `mixed` does that too.
"""

import numpy as np

from planner.design.frequency_posterior import FrequencyOutputs, Poses
from planner.design.variance_reduction import reduction


def integrated_variance(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Expected reduction (n,) of the mean relative frequency variance over the workspace."""
    return reduction(outputs, poses, outputs.workspace)
