"""Importance sampling of a Gaussian likelihood, whose posterior and integral are known."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from planner.surrogate.importance import normal_points, sample

CENTRES = np.array([[0.5, -0.3, 0.2], [-1.0, 1.5, 0.8]])
WIDTHS = np.array([[0.5, 0.7, 2.0], [0.15, 0.3, 0.6]])


def points(samples, count):
    return [normal_points(samples, 3, seed) for seed in range(1, 1 + count)]


def score(z):
    return -0.5 * np.sum(((z - CENTRES[:, None, :]) / WIDTHS[:, None, :]) ** 2, axis=2)


@pytest.mark.parametrize("rounds", [1, 2])
def test_evidence_and_posterior_of_gaussians(rounds):
    z, evidence = sample(score, points(512, 1 + rounds), 2, 128)
    for j in range(2):
        total = np.diag(1 + WIDTHS[j] ** 2)
        constant = np.sum(np.log(WIDTHS[j])) + 1.5 * np.log(2 * np.pi)
        exact = multivariate_normal.logpdf(CENTRES[j], np.zeros(3), total) + constant
        assert evidence[j] == pytest.approx(exact, abs=0.1)
        precision = 1 + WIDTHS[j] ** -2
        sd = precision**-0.5
        mean = CENTRES[j] / WIDTHS[j] ** 2 / precision
        np.testing.assert_allclose(z[j].mean(axis=0), mean, atol=0.35 * sd.max())
        np.testing.assert_allclose(z[j].std(axis=0), sd, rtol=0.35)


def test_a_start_where_the_likelihood_lies_is_used():
    # A likelihood so narrow that no point of the prior comes near it.
    centre, width = np.array([[2.0, -2.5, 2.0]]), 0.01
    start = centre, width * np.eye(3)[None]
    normal = points(64, 2)
    z, _ = sample(
        lambda z: -0.5 * np.sum(((z - centre[:, None, :]) / width) ** 2, axis=2),
        normal,
        1,
        32,
        start,
    )
    assert np.abs(z - centre[:, None, :]).max() < 6 * width
