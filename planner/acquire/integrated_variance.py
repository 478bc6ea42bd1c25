"""Integrated variance: the candidate whose measurement lowers the variance over the workspace most.

The closed form: measuring at c lowers the variance at u by cov(u, c)²/(var(c) + noise)
(Sacks et al. 1989; Cohn 1996), averaged over the workspace, the hyperparameters and the modes.
"""

import numpy as np

from planner.acquire.outputs import FrequencyOutputs

CHUNK = 128  # candidates at a time, so that their covariances stay in the cache


def integrated_variance(outputs: FrequencyOutputs, x: np.ndarray, low: np.ndarray) -> np.ndarray:
    """Expected reduction (n,) of the mean relative frequency variance over the workspace.

    x (n, d) candidates with centred low fidelity (n, k); the workspace is that of `outputs`.
    """
    parts = [
        _reduction(outputs, x[i : i + CHUNK], low[i : i + CHUNK]) for i in range(0, len(x), CHUNK)
    ]
    return np.concatenate(parts) if parts else np.zeros(0)


def _reduction(outputs: FrequencyOutputs, x: np.ndarray, low: np.ndarray) -> np.ndarray:
    score = np.zeros(len(x))
    for k in range(outputs.count):
        covariance, variance, _ = outputs.covariance(k, x, low, outputs.x, outputs.low)
        reduction = np.mean(covariance**2, axis=2) / (variance + outputs.noise[k])
        score += np.mean(reduction, axis=0) * outputs.weights[k]
    return score
