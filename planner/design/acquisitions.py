"""Acquisitions: what measuring at each of n candidates is worth, all axes hit there.

(`stability` has a file of its own; see `propose` for the table.)
"""

import numpy as np

from planner.design.frequency_posterior import FrequencyOutputs, Poses
from planner.design.reductions import parameter_reduction, reduction

COINCIDENCE = 1e-6  # distance in model coordinates below which two poses are the same


def variance(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Weighted mean relative variance (n,) of the natural frequencies: what is known least."""
    each = [outputs.variance(k, poses) * w for k, w in enumerate(outputs.weights)]
    return np.sum(each, axis=0)


def integrated_variance(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Expected reduction (n,) of the mean relative frequency variance over the workspace.

    What the simulation's parameters leave open is not looked at; `mixed` does that too.
    """
    return reduction(outputs, poses, outputs.workspace)


def parameter_variance(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """I-optimal: reduction (n,) of the mean frequency variance that parameters leave."""
    return parameter_reduction(outputs, poses, outputs.workspace)


def mixed(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Both together (n,), for a simulation that learns and whose physics may be incomplete.

    Both are reductions of the same mean variance over the workspace, so that they add up.
    """
    return integrated_variance(outputs, poses) + parameter_variance(outputs, poses)


def goal(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """`mixed` (n,) over what matters most: a path of poses, labels with weights of their own, or
    modes within a band, as `outputs.goal` says.
    """
    target = outputs.goal
    return reduction(outputs, poses, target) + parameter_reduction(outputs, poses, target)


def mutual_information(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Information (n,) in nat about the workspace's frequencies, labels weighed.

    ½ log of the variance of a measurement at c given what is measured, over that given all other
    poses of the workspace as well (Krause, Singh & Guestrin 2008, eq. 7). Unlike variance it is not
    drawn to the edge, where much is unknown that matters nowhere else.
    """
    score = np.zeros(len(poses))
    at = outputs.workspace.poses
    distance = np.linalg.norm(poses.x[:, None] - at.x[None], axis=2)
    same = np.argmin(distance, axis=1)
    coincides = np.min(distance, axis=1) < COINCIDENCE
    for k in np.flatnonzero(outputs.weights).tolist():
        between, _, _ = outputs.covariance(k, at, at)
        inverse = np.linalg.inv(between + outputs.noise[k] * np.eye(len(at)))
        cross, own, _ = outputs.covariance(k, poses, at)
        before = own + outputs.noise[k]
        apart = before - np.einsum("scu,scu->sc", cross @ inverse, cross)
        # A candidate that stands for the workspace itself is no part of its rest.
        alone = 1 / np.diagonal(inverse, axis1=1, axis2=2)[:, same]
        after = np.where(coincides, alone, apart)
        score += outputs.weights[k] * np.mean(0.5 * np.log(before / after), axis=0)
    return score
