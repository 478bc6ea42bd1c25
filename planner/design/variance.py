"""Variance: the candidate about which the model knows least."""

import numpy as np

from planner.design.frequency_posterior import FrequencyOutputs, Poses


def variance(outputs: FrequencyOutputs, poses: Poses) -> np.ndarray:
    """Weighted mean relative variance (n,) of the natural frequencies at n poses."""
    each = [outputs.variance(k, poses) * w for k, w in enumerate(outputs.weights)]
    return np.sum(each, axis=0)
