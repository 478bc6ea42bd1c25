"""Covariance of an output's data, for NumPy and JAX alike."""

from typing import Any

import numpy as np

from planner.surrogate.kernels import parse

IN_CACHE = 2**15  # elements that are worked out together: of more, most time goes into memory


def data_covariance(
    xp: Any, kernel: str, x: Any, low: Any, mask: Any, variance: Any, bias: Any, slope: Any,
    jitter: Any, theta: Any,
) -> Any:  # fmt: skip
    """Covariance (…, c, c) of one output's data at θ (…, p); what does not count is decoupled."""
    delta = parse(kernel, x.shape[1]).covariance(xp, theta, x, x)
    both = mask[:, None] * mask[None, :]
    known = (delta + (bias**2 + slope**2 * low[:, None] * low[None, :])) * both
    alone = _alone(xp, mask, variance, bias, jitter, theta)
    return known + alone[..., None] * xp.eye(len(x))


def prior_covariance(
    kernel: str, theta: np.ndarray, slope: np.ndarray, bias: float, xa: np.ndarray,
    la: np.ndarray, xb: np.ndarray, lb: np.ndarray, lower: bool = False,
) -> np.ndarray:  # fmt: skip
    """Noise-free covariance (k, a, b) of xa (a, d), low la (a,), with xb, lb at θ (k, p).

    By NumPy; slope (k,). Of `lower` most of what is above the diagonal is left 0.
    """
    delta, samples, count = parse(kernel, xa.shape[1]), len(theta), len(xb)
    out = np.zeros((samples, len(xa), count))
    square = slope[:, None, None] ** 2
    band = max(1, IN_CACHE // max(count, 1))
    fewest = max(1, IN_CACHE // max(out[0].size, 1))  # samples
    for some in (slice(i, i + fewest) for i in range(0, samples, fewest)):
        for start in range(0, len(xa), band):
            rows, columns = slice(start, start + band), slice(start + band if lower else count)
            part = delta.covariance(np, theta[some], xa[rows], xb[columns])
            part += bias**2 + square[some] * (la[rows, None] * lb[columns])
            out[some, rows, columns] = part
    return out


def lower_half(
    kernel: str, x: np.ndarray, low: np.ndarray, mask: np.ndarray, variance: np.ndarray,
    bias: float, slope: np.ndarray, jitter: float, theta: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """As `data_covariance`, but for most of what is above the diagonal; slope (k,), θ (k, p)."""
    out = prior_covariance(kernel, theta, slope, bias, x, low, x, low, lower=True)
    unknown = np.flatnonzero(mask == 0)
    out[:, unknown], out[:, :, unknown] = 0.0, 0.0
    np.einsum("kii->ki", out)[...] += _alone(np, mask, variance, bias, jitter, theta)
    return out


def _alone(xp: Any, mask: Any, variance: Any, bias: Any, jitter: Any, theta: Any) -> Any:
    """What is added on the diagonal (…, c): noise, or 1 where a value does not count."""
    noise = variance + xp.exp(2 * theta[..., 1, None])
    noise = noise + jitter * (xp.exp(2 * theta[..., 0, None]) + bias**2)
    return xp.where(mask > 0, noise, 1.0)
