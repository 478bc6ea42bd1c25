"""FRFs of predicted modes with uncertainty: mean and standard deviation by quadrature.

A prediction's frequencies, damping ratios and residues are independent, log-normal the first two,
normal the last. An FRF is a sum over modes of a residue times a function of its pole, so mean and
variance need only that function's moments over two variables, which quadrature gives. Busch et al.
2022 (section 3.4) draw 10,000 quasi-random samples instead; the tests compare with those.
"""

from dataclasses import dataclass

import numpy as np

from planner.frf import synthesis
from planner.inference.per_pose import PerPose

FREQUENCY_REACH = 5.0  # sds of a frequency over which is integrated
FREQUENCY_STEP = 0.5  # at most, in sds and in half widths of the resonance
MOST_NODES = 1000
DAMPING_NODES = 5
LARGEST_DAMPING = 0.95  # of a mode; beyond it there would be no oscillation


@dataclass(frozen=True, eq=False)
class ModalPrediction(PerPose):
    """Predicted modes at q poses with their sd; shapes (q, k) and (q, k, 3, 3).

    `residue_sd` is that of the real and of the imaginary part each (their mean square).
    """

    frequency_hz: np.ndarray
    frequency_sd_hz: np.ndarray
    damping_ratio: np.ndarray
    damping_sd: np.ndarray
    residue: np.ndarray
    residue_sd: np.ndarray


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
        one = prediction[i]
        half_width = one.damping_ratio * one.frequency_hz
        zf, zd, weights = _nodes(float(np.max(one.frequency_sd_hz / half_width)))
        f = log_normal(one.frequency_hz, one.frequency_sd_hz, zf[:, None])
        zeta = log_normal(one.damping_ratio, one.damping_sd, zd[:, None])
        poles = synthesis.pole(f, np.minimum(zeta, LARGEST_DAMPING))  # (nodes, k)
        mean[i], sd[i] = _modal_sum(one.residue, one.residue_sd, poles, weights, frequency_hz)
    return mean, sd


def _nodes(spread: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Standard normal values of frequency and damping (n,), and weights (n,) that sum to one.

    The trapezoidal rule over the frequency errs by exp(−2π half width/step), `spread` being the
    frequency's sd over the resonance's half width; Gauss-Hermite over the damping.
    """
    count = int(min(MOST_NODES, np.ceil(2 * FREQUENCY_REACH / FREQUENCY_STEP * max(1.0, spread))))
    zf = np.linspace(-FREQUENCY_REACH, FREQUENCY_REACH, count + 1)
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


def log_normal(median: np.ndarray, sd: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Values (s, k) of the log-normal with this median and sd, at standard normal z."""
    ratio = sd / median
    log_sd = np.sqrt(np.log((1 + np.sqrt(1 + 4 * ratio**2)) / 2))
    return median * np.exp(log_sd * z)
