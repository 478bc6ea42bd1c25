"""Repeats: what hitting a measured pose again would gain, where its noise is what limits.

A measured value's own variance σ² halves; the nugget, which is the pose's own, stays. With
K the covariance of what was measured, the variance at u falls by
h (K⁻¹k_u)_i² / (1 − h (K⁻¹)_ii), h = σ²/2 (Sherman & Morrison 1950).
"""

import numpy as np

from planner.design.frequency_posterior import FrequencyOutputs


def repeat_gain(outputs: FrequencyOutputs, variance: np.ndarray) -> np.ndarray:
    """Reduction (n,) of the mean variance over the workspace by repeating each measured pose.

    `variance` (n, k) is that of each measured ln f, NaN where the mode was not found; rows are
    the posterior's training poses in their order.
    """
    post, target = outputs.posterior, outputs.workspace
    gain = np.zeros(len(variance))
    for k in range(outputs.count):
        known = np.flatnonzero(post.mask[k])
        if not len(known):
            continue
        _, white = post._cross(k, target.poses.x, target.poses.low[:, k])
        whiten = post.whitening(k)
        pulled = (np.swapaxes(whiten, 1, 2) @ white) ** 2 @ target.importance[:, k]
        half = np.nan_to_num(variance[known, k]) / 2
        left = 1 - half * np.sum(whiten**2, axis=1)
        gain[known] += np.mean(half * pulled / np.maximum(left, 1e-9), axis=0)
    return gain
