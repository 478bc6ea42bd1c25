"""A mixture of Gaussians: probabilities, quantiles and moments belong together."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from planner.surrogate.predictive import Predictive

ONE = Predictive(np.ones(1), np.array([[0.3, -2.0]]), np.array([[0.5, 2.0]]))


def test_of_one_gaussian_all_is_the_gaussian():
    y = np.array([0.1, 1.0])
    np.testing.assert_allclose(ONE.below(y), norm.cdf(y, ONE.means[0], ONE.sds[0]))
    low, high = ONE.quantile(0.025), ONE.quantile(0.975)
    np.testing.assert_allclose(low, ONE.mean - 1.959964 * ONE.sd, atol=1e-5)
    np.testing.assert_allclose(high, ONE.mean + 1.959964 * ONE.sd, atol=1e-5)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 1000), st.floats(0.01, 0.99))
def test_quantiles_undo_probabilities(seed, probability):
    rng = np.random.default_rng(seed)
    w = rng.dirichlet(np.ones(4))
    found = Predictive(w, rng.standard_normal((4, 3)), np.exp(rng.standard_normal((4, 3))))
    np.testing.assert_allclose(found.below(found.quantile(probability)), probability, atol=1e-9)


def test_moments_are_those_of_the_probability_and_scale_and_widen():
    rng = np.random.default_rng(0)
    found = Predictive(np.array([0.2, 0.8]), rng.standard_normal((2, 1)), np.array([[0.3], [1.2]]))
    grid = np.linspace(-9, 9, 4001)
    density = np.gradient([found.below(np.array([v]))[0] for v in grid], grid)
    mean = np.trapezoid(density * grid, grid)
    np.testing.assert_allclose(mean, found.mean[0], atol=1e-4)
    variance = np.trapezoid(density * (grid - mean) ** 2, grid)
    np.testing.assert_allclose(np.sqrt(variance), found.sd[0], atol=1e-4)
    np.testing.assert_allclose(ONE.scaled(1.0, -2.0).mean, 1 - 2 * ONE.mean)
    np.testing.assert_allclose(ONE.widened(np.array([1.2, 1.5])).sd, [1.3, 2.5])
