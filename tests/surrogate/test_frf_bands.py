"""FRFs with uncertainty: exact moments against ten thousand quasi-random samples."""

from dataclasses import replace

import numpy as np
import pytest

from planner.frf import synthesis
from planner.surrogate.frf_bands import (
    LARGEST_DAMPING,
    ModalPrediction,
    frf_moments,
    log_normal,
)
from planner.surrogate.importance import normal_points
from planner.surrogate.modal_surrogate import fit_surrogate
from tests.support.surrogates import observed, simulated

LINES = np.linspace(4, 50, 60)


def prediction(spread=None):
    """Of a surrogate with five poses; `spread` is the relative sd of the frequencies."""
    x = np.random.default_rng(0).random((2, 2))
    p = fit_surrogate(observed(5, 0)).predict(x, simulated(x))
    return p if spread is None else replace(p, frequency_sd_hz=spread * p.frequency_hz)


def sampled(p, samples=10_000):
    """Mean and sd (q, 3, 3, F) by scrambled Sobol points, as in Busch et al. 2022, section 3.4."""
    q, k = p.frequency_hz.shape
    normal = normal_points(samples, 20 * k, 0)
    zr = normal[:, 2 * k :].reshape(samples, k, 3, 3, 2)
    means, sds = [], []
    for i in range(q):
        f = log_normal(p.frequency_hz[i], p.frequency_sd_hz[i], normal[:, :k])
        zeta = log_normal(p.damping_ratio[i], p.damping_sd[i], normal[:, k : 2 * k])
        residue = p.residue[i] + p.residue_sd[i] * (zr[..., 0] + 1j * zr[..., 1])
        poles = synthesis.pole(f, np.minimum(zeta, LARGEST_DAMPING))
        lines = [synthesis.accelerance(LINES[[j]], poles, residue) for j in range(len(LINES))]
        h = np.concatenate(lines, axis=-1)
        means.append(h.mean(axis=0))
        sds.append(h.std(axis=0))
    return np.array(means), np.array(sds)


def test_a_certain_prediction_is_the_modal_sum():
    x = np.random.default_rng(0).random((2, 2))
    low, zero = simulated(x), np.full((2, 4), 1e-9)
    p = ModalPrediction(low.frequency_hz, zero, low.damping_ratio, zero * 0.01, low.residue,
                        np.full((2, 4, 3, 3), 1e-18))  # fmt: skip
    poles = synthesis.pole(low.frequency_hz, low.damping_ratio)
    exact = synthesis.accelerance(LINES, poles, low.residue)
    mean, sd = frf_moments(p, LINES)
    size = np.abs(exact).max()
    np.testing.assert_allclose(mean, exact, atol=1e-6 * size)
    assert sd.max() < 1e-4 * size


@pytest.mark.parametrize("spread", [None, 0.05])
def test_moments_are_those_of_ten_thousand_samples(spread):
    p = prediction(spread)
    (mean, sd), (many, many_sd) = frf_moments(p, LINES), sampled(p)
    size = np.sqrt(np.mean(np.abs(many) ** 2, axis=-1, keepdims=True))
    off = np.abs(sd / many_sd - 1)
    assert np.max(np.abs(mean - many) / size) < 0.002
    assert np.median(off) < 0.002
    assert np.max(off) < 0.02
