"""Variance: the candidate about which the model knows least."""

import numpy as np

from planner.acquire.outputs import FrequencyOutputs


def variance(outputs: FrequencyOutputs, x: np.ndarray, low: np.ndarray) -> np.ndarray:
    """Weighted mean relative variance (n,) of the natural frequencies at x (n, d), low (n, k)."""
    score = np.zeros(len(x))
    for k in range(outputs.count):
        score += outputs.variance(k, x, low) * outputs.weights[k]
    return score
