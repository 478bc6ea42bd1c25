"""FRFs with uncertainty: exact moments against ten thousand quasi-random samples."""

import numpy as np
import pytest

from planner.frf import synthesis
from planner.surrogate.frf_bands import ModalPrediction, frf_moments
from planner.surrogate.modal_surrogate import fit_surrogate
from tests.support.frf_samples import frf_band
from tests.support.surrogates import observed, simulated

LINES = np.linspace(4, 50, 60)


def prediction(spread=None):
    """Of a surrogate with five poses; `spread` is the relative sd of the frequencies."""
    x = np.random.default_rng(0).random((2, 2))
    p = fit_surrogate(observed(5, 0)).predict(x, simulated(x))
    if spread is None:
        return p
    parts = vars(p) | {"frequency_sd_hz": spread * p.frequency_hz}
    return ModalPrediction(**parts)


def test_a_certain_prediction_is_the_modal_sum():
    x = np.random.default_rng(0).random((2, 2))
    low, zero = simulated(x), np.full((2, 4), 1e-9)
    p = ModalPrediction(low.frequency_hz, zero, low.damping_ratio, zero * 0.01, low.residue,
                        np.full((2, 4, 3, 3), 1e-18))  # fmt: skip
    exact = synthesis.accelerance(
        LINES, synthesis.pole(low.frequency_hz, low.damping_ratio), low.residue
    )
    band = frf_band(p, LINES, samples=256)
    size = np.abs(exact).max()
    for mean, sd in (frf_moments(p, LINES), (band.mean, band.sd)):
        np.testing.assert_allclose(mean, exact, atol=1e-6 * size)
        assert sd.max() < 1e-4 * size
    np.testing.assert_allclose(band.lower, np.abs(exact), atol=1e-4 * size)


@pytest.mark.parametrize("spread", [None, 0.05])
def test_moments_are_those_of_ten_thousand_samples(spread):
    p = prediction(spread)
    mean, sd = frf_moments(p, LINES)
    many = frf_band(p, LINES, samples=10_000)
    size = np.sqrt(np.mean(np.abs(many.mean) ** 2, axis=-1, keepdims=True))
    off = np.max(np.abs(mean - many.mean) / size)
    ratio = sd / many.sd
    print(f"mean off by {off:.4f} of the FRF, sd by {np.abs(ratio - 1).max():.4f}")
    assert off < 0.002
    assert np.median(np.abs(ratio - 1)) < 0.002
    assert np.max(np.abs(ratio - 1)) < 0.02


def test_the_band_holds_its_share():
    p = prediction()
    band = frf_band(p, LINES, 0.9, samples=2048, seed=1)
    other = frf_band(p, LINES, 0.5, samples=2048, seed=2)
    assert (band.lower < other.lower).all()
    assert (band.upper > other.upper).all()
    assert (band.lower < np.abs(band.mean)).mean() > 0.9
