"""Stability: the candidate after which it is surest whether a cut is stable.

What matters are the poses at which that is least sure and the modes on which it hangs there, as
`outputs.goal` says: targeted integrated variance (Picheny et al., J. Mechanical Design 132, 2010)
of the logarithm of the largest multiplier, to first order in the frequencies.
"""

import numpy as np

from planner.design.frequency_posterior import FrequencyOutputs, Poses
from planner.design.goal import goal


def stability(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Expected reduction (n,) of the variance on which the decision hangs."""
    return goal(outputs, poses)
