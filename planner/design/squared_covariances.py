"""Squared posterior covariances of candidates with a target, summed up."""

import numpy as np

from planner.surrogate.kernels import parse

BLOCK_CANDIDATES = 128  # at a time: their covariances with the target stay in the cache


def squared_covariances(
    kernel: str,
    theta: np.ndarray,
    x: np.ndarray,
    a: np.ndarray,
    xu: np.ndarray,
    b: np.ndarray,
    weight: np.ndarray,
) -> np.ndarray:
    """Σ_u weight_u cov(c, u)² (n,) of one block of candidates c, by NumPy, as is quick for few."""
    delta = parse(kernel, x.shape[1])
    return (delta.covariance(np, theta, x, xu) + a @ b.T) ** 2 @ weight
