"""Sums of what is given by its logarithms; SciPy's functions take 0.1 s to import."""

import numpy as np


def log_sum(values: np.ndarray, axis: int) -> np.ndarray:
    """ln Σ exp(values) along one axis, which is taken away; −∞ where all are."""
    largest = np.max(values, axis=axis, keepdims=True)
    largest = np.where(np.isfinite(largest), largest, 0.0)
    with np.errstate(divide="ignore"):
        total = np.log(np.sum(np.exp(values - largest), axis=axis))
    return total + np.squeeze(largest, axis)


def shares(values: np.ndarray, axis: int) -> np.ndarray:
    """exp(values) over their sum along one axis; some are finite."""
    powers = np.exp(values - np.max(values, axis=axis, keepdims=True))
    return powers / np.sum(powers, axis=axis, keepdims=True)
