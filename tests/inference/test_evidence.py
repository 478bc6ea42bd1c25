"""Log evidence against numbers that are known otherwise."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from planner.inference.evidence import (
    bootstrapped,
    laplace,
    occam,
    probability,
    savage_dickey,
    unexplained_shares,
)


def test_laplace_is_exact_for_a_linear_model():
    rng = np.random.default_rng(1)
    design, prior_sd = rng.standard_normal((8, 3)), np.array([0.5, 2.0, 1.0])
    data = rng.standard_normal(8)
    precision = design.T @ design + np.diag(1 / prior_sd**2)
    x = np.linalg.solve(precision, design.T @ data)
    chi2 = float(np.sum((data - design @ x) ** 2))
    found = laplace(chi2, x / prior_sd, precision, prior_sd, 1.0) - 4 * np.log(2 * np.pi)
    covariance = np.eye(8) + design @ np.diag(prior_sd**2) @ design.T
    exact = multivariate_normal(np.zeros(8), covariance).logpdf(data)
    assert found == pytest.approx(exact)


def test_occam_is_laplace_where_parameters_are_independent():
    away, sd, prior_sd = np.array([1.0, -0.5]), np.array([0.1, 0.2]), np.array([1.0, 3.0])
    whole = laplace(0.0, away, np.diag(1 / sd**2), prior_sd, 1.0)
    assert -occam(away, sd, prior_sd) == pytest.approx(whole)
    assert occam(np.zeros(1), np.array([9.0]), np.ones(1)) == 0.0  # told nothing, cost nothing


def test_savage_dickey_is_the_ratio_of_densities_at_none():
    value, sd, prior_sd = 0.3, 0.1, 2.0
    ratio = norm(0, prior_sd).logpdf(0) - norm(value, sd).logpdf(0)
    assert savage_dickey(value, sd, prior_sd) == pytest.approx(ratio)


def test_probability_of_odds():
    assert probability(0.0, 0.05) == pytest.approx(0.05)
    assert probability(np.log(19), 0.05) == pytest.approx(0.5)
    assert probability(1e9, 0.05) == 1.0
    assert probability(-1e9, 0.05) < 1e-300


def test_what_leaves_twice_as_much_is_less_probable():
    share = unexplained_shares([2.0, 1.0], 8.0)
    assert share.sum() == pytest.approx(1.0)
    assert share[1] / share[0] == pytest.approx(16.0)


def test_a_gain_at_one_pose_alone_gives_no_certainty():
    even = np.full((2, 10), 20.0)
    even[1] -= 4.0  # the second model gains alike at all poses
    single = np.full((2, 10), 20.0)
    single[1, 0] -= 40.0  # as much in all, at one of them
    evidence = np.array([0.0, 20.0])
    broad = bootstrapped(even, evidence, 1.0, -50.0, 4000, 0)
    narrow = bootstrapped(single, evidence, 1.0, -50.0, 4000, 0)
    assert broad.sum() == pytest.approx(1.0)
    assert broad[1] > 0.999
    assert narrow[1] < broad[1] - 0.01
