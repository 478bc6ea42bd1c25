"""Likelihood of an output's data at many hyperparameters at once.

Few poses are done by NumPy: importing JAX and tracing a function for them would take a second, and
gain nothing. Which of the two it is follows from the sizes alone, so that it is the same each time.
"""

import numpy as np

from planner.surrogate.data_covariance import lower_half
from planner.surrogate.training_data import Padded

# Elements of all covariances together up to which NumPy is as fast: 4 outputs, 256 samples and 64
# poses take it 0.1 s, those of 32 poses 0.025 s (compiled: 0.013 s after 0.24 s of tracing).
NUMPY_ELEMENTS = 2**22


def log_likelihoods(
    kernel: str, data: Padded, y: np.ndarray, bias_sd: np.ndarray, slope_sd: np.ndarray,
    jitter: float, theta: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """(m, s) of y (m, c) at θ (m, s, p), without the constant; −∞ where there is none."""
    outputs = y, data.low, data.mask, data.variance, bias_sd, slope_sd
    m, samples, _ = theta.shape
    x = np.broadcast_to(data.x, (m, *data.x.shape[-2:]))
    if m * samples * x.shape[1] ** 2 > NUMPY_ELEMENTS:
        from planner.surrogate.compiled_likelihood import compiled_log_likelihoods

        return compiled_log_likelihoods(kernel, x, *outputs, jitter, theta)
    return np.array(
        [
            _of_an_output(kernel, x[j], jitter, theta[j], *(values[j] for values in outputs))
            for j in range(m)
        ]
    )


def _of_an_output(
    kernel: str, x: np.ndarray, jitter: float, theta: np.ndarray, y: np.ndarray, low: np.ndarray,
    mask: np.ndarray, variance: np.ndarray, bias: float, slope: float,
) -> np.ndarray:  # fmt: skip
    """(s,) at θ (s, p)."""
    # A sample whose covariance overflows or is singular has no likelihood.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        slopes = np.full(len(theta), slope)
        k = lower_half(kernel, x, low, mask, variance, bias, slopes, jitter, theta)
        factor = _factors(k)
        white = np.tile(y, (len(theta), 1))
        for i in range(len(y)):  # forward substitution, all samples side by side
            white[:, i] /= factor[:, i, i]
            white[:, i + 1 :] -= factor[:, i + 1 :, i] * white[:, i, None]
        diagonal = np.diagonal(factor, axis1=1, axis2=2)
        value = -0.5 * np.sum(white**2, axis=1) - np.sum(np.log(diagonal), axis=1)
    return np.where(np.isfinite(value), value, -np.inf)


def _factors(k: np.ndarray) -> np.ndarray:
    """Cholesky factors of k (s, c, c); NaN where one is not positive definite."""
    try:
        return np.linalg.cholesky(k)
    except np.linalg.LinAlgError:
        pass
    factors = np.full_like(k, np.nan)
    for factor, one in zip(factors, k, strict=True):
        try:
            factor[:] = np.linalg.cholesky(one)
        except np.linalg.LinAlgError:
            continue
    return factors
