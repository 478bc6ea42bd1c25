"""FRFs of hits of unequal strength whose noise grows with the hit."""

from pathlib import Path

import numpy as np

from planner.frf.estimator import estimate
from planner.recording.records import Hit

RATE_HZ, SAMPLES = 400.0, 1024


def hits(rng, noise=0.02):
    """Hits of 0.4, 1 and 2.5 times a middling force on a mass-less mixing of the force."""
    t = np.arange(SAMPLES) / RATE_HZ
    found = []
    for axis in "xyz":
        for level in (0.4, 1.0, 2.5):
            phase = np.clip((t - 0.06) / 0.02, 0, 1)
            force = 100 * level * np.sin(np.pi * phase) ** 2
            ring = np.exp(-6 * t) * np.sin(2 * np.pi * 15 * t)
            response = np.convolve(force, ring)[:SAMPLES] / RATE_HZ
            clean = np.outer([1.0, 0.5, 2.0], response)
            size = noise * np.sqrt(np.mean(clean**2, axis=1).max())
            noisy = clean + size * rng.standard_normal(clean.shape)
            found.append(Hit(Path("x"), f"+{axis}", RATE_HZ, force, noisy))
    return tuple(found)


def misfit(make, seeds=12):
    """Mean |δH|² over its stated variance, 1 where that is honest, and the true error."""
    clean = make(hits(np.random.default_rng(0), 0.0))
    ratios, errors = [], []
    for seed in range(seeds):
        frf = make(hits(np.random.default_rng(seed + 1)))
        used = (frf.frequency_hz > 4) & (frf.frequency_hz < 60)
        error = np.abs(frf.accelerance - clean.accelerance)[..., used] ** 2
        ratios.append(np.mean(error / frf.variance[..., used]))
        errors.append(np.mean(error))
    return np.mean(ratios), np.mean(errors)


def test_variance_is_honest_and_error_smaller_than_that_of_h1():
    band = (4.0, 60.0)
    ratio, error = misfit(lambda h: estimate(h, band, "weighted", 2.0))
    plain_ratio, plain_error = misfit(lambda h: estimate(h, band, exponential_rate_1_s=2.0))
    assert 0.8 < ratio < 1.25
    assert plain_ratio > ratio
    assert error < 0.8 * plain_error
