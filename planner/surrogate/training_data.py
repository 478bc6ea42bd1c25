"""Training data of many outputs over one set of poses, their prior, and their covariance."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from planner.surrogate.kernels import parse

PADDED_SIZES = (16, 32, 64, 128)  # each is compiled once, as are multiples of the last


@dataclass(frozen=True, eq=False)
class TrainingData:
    """n poses, m outputs. x (n, d) in model coordinates; y, sd, low (n, m), NaN where missing.

    `low` is the simulation's value of the same output; a column without any number has none.
    A value whose sd is NaN still counts: the nugget, which is learned, is then all its noise.
    """

    x: np.ndarray
    y: np.ndarray
    sd: np.ndarray
    low: np.ndarray


@dataclass(frozen=True, eq=False)
class Padded:
    """The same, output first, with `mask` (m, c) saying which entries count."""

    x: np.ndarray  # (c, d), or (m, c, d) where outputs have points of their own
    y: np.ndarray  # (m, c)
    variance: np.ndarray  # (m, c)
    low: np.ndarray  # (m, c)
    mask: np.ndarray  # (m, c)

    def widened(self, scale: np.ndarray) -> "Padded":
        """With coordinates (m, c, d + 1): x, and low over its scale (m,)."""
        x = np.broadcast_to(self.x, (*self.low.shape, self.x.shape[-1]))
        own = self.low[..., None] / scale[:, None, None]
        return replace(self, x=np.concatenate([x, own], axis=-1))


@dataclass(frozen=True, eq=False)
class Prior:
    """Prior of m outputs: mean (m,), sd of b and ρ' (m,), θ's mean and sd (m, p).

    `nugget_shared` (m,) is the share of log τ's variance that the outputs have in common; (1,): all
    alike.
    """

    mean: np.ndarray
    bias_sd: np.ndarray
    slope_sd: np.ndarray
    theta_mean: np.ndarray
    theta_sd: np.ndarray
    nugget_shared: np.ndarray = field(default_factory=lambda: np.zeros(1))


def data_covariance(
    xp: Any, kernel: str, theta: Any, jitter: Any, x: Any, low: Any, mask: Any, variance: Any,
    bias: Any, slope: Any,
) -> Any:  # fmt: skip
    """Covariance (c, c) of one output's data at θ (p,); what does not count is decoupled.

    By `xp`, NumPy or jax.numpy; `jitter` is relative to the prior variance.
    """
    delta = parse(kernel, x.shape[1]).covariance(xp, theta, x, x)
    known = delta + (bias**2 + slope**2 * low[:, None] * low[None, :])
    noise = variance + xp.exp(2 * theta[1]) + jitter * (xp.exp(2 * theta[0]) + bias**2)
    alone = xp.where(mask > 0, noise, 1.0)
    return known * (mask[:, None] * mask[None, :]) + alone[:, None] * xp.eye(len(x))


def capacity(n: int) -> int:
    """Smallest padded size that holds n poses."""
    return next((c for c in PADDED_SIZES if c >= n), -(-n // PADDED_SIZES[-1]) * PADDED_SIZES[-1])


def pad(data: TrainingData, uses_low: np.ndarray) -> Padded:
    """Pad to capacity. A value counts if it is known, and its low fidelity too where used."""
    known = np.isfinite(data.y) & ~np.isinf(data.sd) & (np.isfinite(data.low) | ~uses_low)
    y, low = np.where(known, data.y, 0.0), np.where(known & uses_low, data.low, 0.0)
    variance = np.where(known, np.nan_to_num(data.sd), 1.0) ** 2
    more = capacity(len(data.x)) - len(data.x)

    def padded(values: np.ndarray, by: float = 0.0) -> np.ndarray:
        return np.pad(values.T, [(0, 0), (0, more)], constant_values=by)

    x = np.pad(data.x, [(0, more), (0, 0)])
    return Padded(x, padded(y), padded(variance, 1.0), padded(low), padded(known.astype(float)))


def thinned(data: Padded, size: int) -> Padded:
    """At most `size` of each output's known points, spread evenly over their order."""
    rows = np.array([_spread(mask, size) for mask in data.mask])
    each = np.arange(len(rows))[:, None]
    picked = (v[each, rows] for v in (data.y, data.variance, data.low, data.mask))
    x = np.broadcast_to(data.x, (len(rows), *data.x.shape[-2:]))
    return Padded(x[each, rows], *picked)


def _spread(mask: np.ndarray, size: int) -> np.ndarray:
    """Indices (size,) of known entries, filled up with others, in order."""
    known, other = np.flatnonzero(mask > 0), np.flatnonzero(mask <= 0)
    most = min(size, len(known))
    some = known[np.linspace(0, len(known) - 1, most).round().astype(int)]
    rest = np.setdiff1d(known, some)
    return np.sort(np.concatenate([some, np.concatenate([other, rest])[: size - most]]))
