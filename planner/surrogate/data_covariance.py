"""Covariance of an output's data, for NumPy and JAX alike."""

from typing import Any

from planner.surrogate.kernels import parse


def data_covariance(
    xp: Any, kernel: str, x: Any, low: Any, mask: Any, variance: Any, bias: Any, slope: Any,
    jitter: Any, theta: Any,
) -> Any:  # fmt: skip
    """Covariance (…, c, c) of one output's data at θ (…, p); what does not count is decoupled."""
    delta = parse(kernel, x.shape[1]).covariance(xp, theta, x, x)
    both = mask[:, None] * mask[None, :]
    known = (delta + (bias**2 + slope**2 * low[:, None] * low[None, :])) * both
    noise = variance + xp.exp(2 * theta[..., 1, None])
    noise = noise + jitter * (xp.exp(2 * theta[..., 0, None]) + bias**2)
    return known + xp.where(mask > 0, noise, 1.0)[..., None] * xp.eye(len(x))
