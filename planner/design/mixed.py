"""Mixed: information about the simulation's parameters plus information about its discrepancy.

For a simulation that learns and whose physics may be incomplete: both are reductions of the same
mean variance over the workspace, so that they add up.
"""

import numpy as np

from planner.design.frequency_posterior import FrequencyOutputs, Poses
from planner.design.parameter_information import parameter_reduction
from planner.design.variance_reduction import reduction


def mixed(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Expected reduction (n,) of the mean relative frequency variance over the workspace."""
    return reduction(outputs, poses, outputs.workspace) + parameter_reduction(
        outputs, poses, outputs.workspace
    )
