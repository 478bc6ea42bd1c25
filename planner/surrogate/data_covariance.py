"""Covariance of an output's data, for NumPy and JAX alike."""

from typing import Any

import numpy as np

from planner.surrogate.kernels import parse


def data_covariance(
    xp: Any, kernel: str, x: Any, low: Any, mask: Any, variance: Any, bias: Any, slope: Any,
    jitter: Any, theta: Any,
) -> Any:  # fmt: skip
    """Covariance (…, c, c) of one output's data at θ (…, p); what does not count is decoupled."""
    delta = parse(kernel, x.shape[1]).covariance(xp, theta, x, x)
    both = mask[:, None] * mask[None, :]
    linear = bias**2 + slope**2 * low[:, None] * low[None, :]
    noise = variance + xp.exp(2 * theta[..., 1, None])
    noise = noise + jitter * (xp.exp(2 * theta[..., 0, None]) + bias**2)
    alone = xp.where(mask > 0, noise, 1.0)
    if xp is not np:
        return (delta + linear) * both + alone[..., None] * xp.eye(len(x))
    delta += linear  # in place: of many points each array costs more than what is done with it
    if not mask.all():
        delta *= both
    np.einsum("...ii->...i", delta)[...] += alone
    return delta
