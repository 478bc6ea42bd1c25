"""FRFs of predicted modes, with uncertainty: exact moments, and quasi-Monte-Carlo beside them.

A prediction's frequencies, damping ratios and residues are independent, log-normal the first two,
normal the last. An FRF is a sum over modes of a residue times a function of its pole, so mean and
variance need only that function's moments over two variables: quadrature does it (`frf_moments`).
Bands of the magnitude need samples (`frf_band`; seed 000, section 3.4; Saltelli et al. 2010).
"""

from dataclasses import dataclass

import numpy as np

from planner.frf import synthesis
from planner.surrogate.quasi_random import normal_points

SAMPLES = 10_000
REACH = 5.0  # sds of a frequency over which is integrated
STEP = 0.5  # of that integral, at most: in sds and in half widths of the resonance
MOST_NODES = 1000
DAMPING_NODES = 5
MOST_DAMPED = 0.95
CHUNK = 64  # samples at a time, which stay in the cache


@dataclass(frozen=True, eq=False)
class ModalPrediction:
    """Predicted modes at q poses with their sd; shapes (q, k) and (q, k, 3, 3).

    `residue_sd` is that of the real and of the imaginary part each (their mean square).
    """

    frequency_hz: np.ndarray
    frequency_sd_hz: np.ndarray
    damping_ratio: np.ndarray
    damping_sd: np.ndarray
    residue: np.ndarray
    residue_sd: np.ndarray


@dataclass(frozen=True, eq=False)
class FrfBand:
    """Of q poses and F lines: mean and sd of the complex FRF, and a band of its magnitude.

    mean (q, 3, 3, F) in m/s²/N, sd the root of E|H − mean|², lower and upper bounds of |H|.
    """

    mean: np.ndarray
    sd: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


def frf_moments(
    prediction: ModalPrediction, frequency_hz: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (q, 3, 3, F), complex, and sd (q, 3, 3, F) of the accelerance in m/s²/N.

    sd is the root of E|H − mean|². Exact but for the quadrature over each pole.
    """
    q, lines = len(prediction.frequency_hz), len(frequency_hz)
    mean = np.empty((q, 3, 3, lines), dtype=complex)
    sd = np.empty((q, 3, 3, lines))
    for i in range(q):
        half_width = prediction.damping_ratio[i] * prediction.frequency_hz[i]
        zf, zd, weights = _nodes(float(np.max(prediction.frequency_sd_hz[i] / half_width)))
        f = log_normal(prediction.frequency_hz[i], prediction.frequency_sd_hz[i], zf[:, None])
        zeta = log_normal(prediction.damping_ratio[i], prediction.damping_sd[i], zd[:, None])
        poles = synthesis.pole(f, np.minimum(zeta, MOST_DAMPED))  # (nodes, k)
        mean[i], sd[i] = _modal_sum(
            prediction.residue[i], prediction.residue_sd[i], poles, weights, frequency_hz
        )
    return mean, sd


def _nodes(spread: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Standard normal values of frequency and damping (n,), and weights (n,) that sum to one.

    The trapezoidal rule over the frequency errs by exp(−2π half width/step), `spread` being the
    frequency's sd over the resonance's half width; Gauss-Hermite over the damping.
    """
    count = int(min(MOST_NODES, np.ceil(2 * REACH / STEP * max(1.0, spread))))
    zf = np.linspace(-REACH, REACH, count + 1)
    zd, wd = np.polynomial.hermite_e.hermegauss(DAMPING_NODES)
    both = np.outer(np.exp(-(zf**2) / 2), wd).ravel()
    return np.repeat(zf, len(zd)), np.tile(zd, len(zf)), both / both.sum()


def _modal_sum(
    residue: np.ndarray, residue_sd: np.ndarray, poles: np.ndarray, weights: np.ndarray,
    frequency_hz: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Moments of Σ R g + R* g̃, where g = −ω²/(iω − λ) and g̃ has λ* instead of λ."""
    iw = 2j * np.pi * frequency_hz
    total, variance = 0.0, 0.0
    for r, s, pole in zip(residue, residue_sd, poles.T, strict=True):
        g, h = iw**2 / (iw - pole[:, None]), iw**2 / (iw - pole.conj()[:, None])
        r, s = r[..., None], s[..., None]
        mean = r * (weights @ g) + r.conj() * (weights @ h)
        power = weights @ (g.real**2 + g.imag**2 + h.real**2 + h.imag**2)
        cross = weights @ (g * h.conj())
        # E|R|² = |r|² + 2 s², E R² = r², for both parts of R have the same variance.
        square = (np.abs(r) ** 2 + 2 * s**2) * power + 2 * (r**2 * cross).real
        total, variance = total + mean, variance + square - np.abs(mean) ** 2
    return np.asarray(total), np.sqrt(np.maximum(variance, 0.0))


def frf_band(
    prediction: ModalPrediction, frequency_hz: np.ndarray, level: float = 0.95,
    samples: int = SAMPLES, seed: int = 0, rows: int = 32,
) -> FrfBand:  # fmt: skip
    """The same by scrambled Sobol points, with the band that holds `level` of |H|.

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
    return synthesis.pole(f, np.minimum(zeta, MOST_DAMPED)), residue


def _frfs(frequency_hz: np.ndarray, poles: np.ndarray, residue: np.ndarray) -> np.ndarray:
    """(s, 3, 3, F)."""
    chunks = [slice(start, start + CHUNK) for start in range(0, len(poles), CHUNK)]
    return np.concatenate(
        [synthesis.accelerance(frequency_hz, poles[c], residue[c]) for c in chunks]
    )


def log_normal(median: np.ndarray, sd: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Values (s, k) of the log-normal with this median and sd, at standard normal z."""
    ratio = sd / median
    log_sd = np.sqrt(np.log((1 + np.sqrt(1 + 4 * ratio**2)) / 2))
    return median * np.exp(log_sd * z)
