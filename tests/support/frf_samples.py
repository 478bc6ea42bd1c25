"""FRFs of predicted modes by quasi-random samples: the reference of the exact moments.

As in Busch et al. 2022, section 3.4 (Saltelli et al. 2010).
"""

from dataclasses import dataclass

import numpy as np

from planner.frf import synthesis
from planner.surrogate.frf_bands import LARGEST_DAMPING, ModalPrediction, log_normal
from planner.surrogate.importance import normal_points

SAMPLES = 10_000
CHUNK = 64  # samples at a time, which stay in the cache


@dataclass(frozen=True, eq=False)
class FrfBand:
    """Of q poses and F lines: mean and sd of the complex FRF, and a band of its magnitude.

    mean (q, 3, 3, F) in m/s²/N, sd the root of E|H − mean|², lower and upper bounds of |H|.
    """

    mean: np.ndarray
    sd: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


def frf_band(
    prediction: ModalPrediction, frequency_hz: np.ndarray, level: float = 0.95,
    samples: int = SAMPLES, seed: int = 0, rows: int = 32,
) -> FrfBand:  # fmt: skip
    """Moments by scrambled Sobol points, with the band that holds `level` of |H|.

    `rows` lines are worked on at a time, for quantiles need every sample of a line.
    """
    q, k = prediction.frequency_hz.shape
    normal = normal_points(samples, 20 * k, seed)
    shape = (q, 3, 3, len(frequency_hz))
    mean, parts = np.empty(shape, complex), [np.empty(shape) for _ in range(3)]
    for i in range(q):
        poles, residue = _draws(prediction, i, normal)
        for start in range(0, len(frequency_hz), rows):
            part = slice(start, start + rows)
            h = _frfs(frequency_hz[part], poles, residue)
            mean[i, ..., part] = h.mean(axis=0)
            size = np.abs(h)
            variance = np.mean(size**2, axis=0) - np.abs(mean[i, ..., part]) ** 2
            bounds = np.quantile(size, [(1 - level) / 2, (1 + level) / 2], axis=0)
            for out, value in zip(parts, (np.sqrt(np.maximum(variance, 0)), *bounds), strict=True):
                out[i, ..., part] = value
    return FrfBand(mean, *parts)


def _draws(
    prediction: ModalPrediction, i: int, normal: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Poles (s, k) and residues (s, k, 3, 3) of pose i."""
    k = prediction.frequency_hz.shape[1]
    zr = normal[:, 2 * k :].reshape(len(normal), k, 3, 3, 2)
    f = log_normal(prediction.frequency_hz[i], prediction.frequency_sd_hz[i], normal[:, :k])
    zeta = log_normal(prediction.damping_ratio[i], prediction.damping_sd[i], normal[:, k : 2 * k])
    residue = prediction.residue[i] + prediction.residue_sd[i] * (zr[..., 0] + 1j * zr[..., 1])
    return synthesis.pole(f, np.minimum(zeta, LARGEST_DAMPING)), residue


def _frfs(frequency_hz: np.ndarray, poles: np.ndarray, residue: np.ndarray) -> np.ndarray:
    """(s, 3, 3, F)."""
    chunks = [slice(start, start + CHUNK) for start in range(0, len(poles), CHUNK)]
    return np.concatenate(
        [synthesis.accelerance(frequency_hz, poles[c], residue[c]) for c in chunks]
    )
