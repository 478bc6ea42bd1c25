"""Mutual information: the candidate most informative about the rest of the workspace.

½ log of the variance of a measurement at c given what is measured, over that given all other
poses of the workspace as well (Krause, Singh & Guestrin 2008, eq. 7). Unlike variance it is not
drawn to the edge, where much is unknown that matters nowhere else.
"""

import numpy as np

from planner.design.frequency_posterior import FrequencyOutputs, Poses

COINCIDENCE = 1e-6  # distance in model coordinates below which two poses are the same


def mutual_information(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Information (n,) in nat about the workspace's frequencies, labels weighed."""
    score = np.zeros(len(poses))
    at = outputs.workspace.poses
    distance = np.linalg.norm(poses.x[:, None] - at.x[None], axis=2)
    same = np.argmin(distance, axis=1)
    coincides = np.min(distance, axis=1) < COINCIDENCE
    for k, weight in enumerate(outputs.weights):
        if not weight:
            continue
        between, _, _ = outputs.covariance(k, at, at)
        inverse = np.linalg.inv(between + outputs.noise[k] * np.eye(len(at)))
        cross, variance, _ = outputs.covariance(k, poses, at)
        before = variance + outputs.noise[k]
        apart = before - np.einsum("scu,scu->sc", cross @ inverse, cross)
        # A candidate that stands for the workspace itself is no part of its rest.
        alone = 1 / np.diagonal(inverse, axis1=1, axis2=2)[:, same]
        after = np.where(coincides, alone, apart)
        score += weight * np.mean(0.5 * np.log(before / after), axis=0)
    return score
