"""Squared posterior covariances of many candidates with a target, summed up.

By NumPy: a proposal is one pass, over before JAX is imported and has compiled it.
"""

import numpy as np

from planner.surrogate.kernels import parse

BLOCK = 128  # candidates at a time: their covariances with the target stay in the cache


def squared_covariances(
    kernel: str, thetas: np.ndarray, x: np.ndarray, a: np.ndarray, xu: np.ndarray, b: np.ndarray,
    weight: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Σ_u weight_u cov(c, u)² (s, n) at θ (s, p) of n candidates c with the target's points u.

    The covariance is the kernel of x (n, d) and xu (u, d), and the inner product of features
    a (s, n, r) and b (s, u, r).
    """
    delta, out = parse(kernel, x.shape[1]), np.empty(a.shape[:2])
    for start in range(0, len(x), BLOCK):
        block = slice(start, start + BLOCK)
        for theta, own, there, done in zip(thetas, a, b, out, strict=True):
            covariance = delta.covariance(np, theta, x[block], xu) + own[block] @ there.T
            done[block] = covariance**2 @ weight
    return out
