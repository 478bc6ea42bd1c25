"""Sparse GP and deep GP: the bound, its slope, the exact limit, scale."""

from dataclasses import replace

import numpy as np
import pytest

from planner.surrogate.kernels import parse
from planner.surrogate.models.fidelity_levels import Exact, Samples
from planner.surrogate.models.quadrature_mfdgp import fit_quadrature_mfdgp
from planner.surrogate.models.sparse_gp import PRIOR, bound, choose_inducing, fit_sparse

GRID = np.random.default_rng(8).random((50, 2))


def wave(x):
    return np.sin(5 * x[:, 0]) + np.cos(3 * x[:, 1])


def data(n, seed=0, sd=0.05):
    rng = np.random.default_rng(seed)
    x = rng.random((n, 2))
    return Samples.of(x, wave(x) + sd * rng.standard_normal(n), sd)


def exact(samples, fitted, x):
    """Log-likelihood, mean and sd of the exact GP at the same hyperparameters."""
    k = parse(fitted.kernel, 2)
    y = (samples.y - fitted.centre) / fitted.scale
    noise = (samples.sd / fitted.scale) ** 2 + np.exp(2 * fitted.theta[1])
    bias = PRIOR.bias_sd**2
    covariance = k.covariance(np, fitted.theta, samples.x, samples.x) + bias + np.diag(noise)
    cross = k.covariance(np, fitted.theta, samples.x, x) + bias
    mean = cross.T @ np.linalg.solve(covariance, y)
    variance = k.variance(np, fitted.theta, x) + bias
    variance = variance - np.sum(cross * np.linalg.solve(covariance, cross), axis=0)
    size = np.linalg.slogdet(2 * np.pi * covariance)[1] + 2 * len(y) * np.log(fitted.scale)
    value = -0.5 * (y @ np.linalg.solve(covariance, y) + size)
    return value, fitted.centre + fitted.scale * mean, fitted.scale * np.sqrt(variance)


def test_with_every_point_inducing_it_is_the_exact_gp():
    s = data(40)
    fitted = fit_sparse(s, "rbf", 40)
    value, mean, sd = exact(s, fitted, GRID)
    assert fitted.log_evidence == pytest.approx(value, abs=0.5)
    np.testing.assert_allclose(fitted.predict(GRID)[0], mean, atol=2e-3)
    np.testing.assert_allclose(fitted.predict(GRID)[1], sd, rtol=0.05, atol=1e-3)


def test_the_bound_is_below_the_evidence_and_rises_with_inducing_points():
    s = data(80)
    theta = fit_sparse(s, "rbf", 60).theta
    y = (s.y - s.y.mean()) / s.y.std()
    mean, sd = theta, np.ones(len(theta))
    variance = (s.sd / s.y.std()) ** 2
    values = []
    for count in (5, 15, 60):
        u = choose_inducing(parse("rbf", 2), theta, s.x, count)
        values.append(float(bound("rbf", 0 * theta, s.x, y, variance, np.ones(80), u, mean, sd)[0]))
    assert values[0] < values[1] < values[2] + 1e-6
    fitted = fit_sparse(s, "rbf", 10)
    assert fitted.log_evidence <= exact(s, fitted, GRID)[0] + 1e-6


def test_slope_agrees_with_finite_differences():
    s, rng = data(30), np.random.default_rng(1)
    z, mean, sd = 0.3 * rng.standard_normal(4), np.array([0.0, -2, 0, 0]), np.ones(4)
    fixed = (s.x, s.y, s.sd**2, rng.random(30), s.x[:8], mean, sd)
    direction = rng.standard_normal(4)
    ends = [float(bound("rbf", z + h * direction, *fixed)[0]) for h in (1e-5, -1e-5)]
    slope = np.array(bound("rbf", z, *fixed)[1])
    assert slope @ direction == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-5)


def test_a_point_of_weight_two_is_two_points():
    s = data(12)
    doubled = Samples(np.vstack([s.x, s.x]), np.r_[s.y, s.y], np.r_[s.sd, s.sd])
    a = fit_sparse(s, "rbf", 12, np.full(12, 2.0))
    b = fit_sparse(doubled, "rbf", 12)
    np.testing.assert_allclose(a.predict(GRID)[0], b.predict(GRID)[0], atol=1e-4)


def test_thousands_of_points_are_followed():
    s = data(3000)
    mean, sd = fit_sparse(s, "rbf", 60).predict(GRID)
    assert np.sqrt(np.mean((mean - wave(GRID)) ** 2)) < 0.02
    assert np.mean(np.abs(mean - wave(GRID)) < 1.96 * sd) > 0.8


def test_a_deep_gp_follows_a_bent_relation_and_its_low_level():
    rng = np.random.default_rng(3)
    x = rng.random((25, 2))

    def bent(x):
        return np.tanh(2 * wave(x)) + 0.3 * x[:, 0]

    low = rng.random((150, 2))
    below = fit_sparse(Samples.of(low, wave(low)), "rbf", 80)
    deep = fit_quadrature_mfdgp(Samples.of(x, bent(x)), below, 80)
    plain = fit_sparse(Samples.of(x, bent(x)), "rbf", 25)
    off = [np.sqrt(np.mean((m.predict(GRID)[0] - bent(GRID)) ** 2)) for m in (deep, plain)]
    assert off[0] < 0.6 * off[1]


def test_an_unsure_first_layer_makes_the_deep_gp_unsure():
    class Unsure(Exact):
        def predict(self, x):
            return self.function(x), np.full(len(x), 0.4)

    sure = fit_quadrature_mfdgp(data(25, sd=0.01), Exact(wave), 25)
    unsure = replace(sure, low=Unsure(wave))
    assert unsure.predict(GRID)[1].mean() > 2 * sure.predict(GRID)[1].mean()
