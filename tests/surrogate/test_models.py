"""Models of one output, averaged and of the greatest likelihood: limits, integrals, what bends."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from planner.surrogate.kernels import parse, perdikaris
from planner.surrogate.models.averaged import fit_averaged
from planner.surrogate.models.likelihood_gp import (
    Exact,
    Normalisation,
    Samples,
    at_hyperparameters,
    fit_growing,
    fit_likelihood,
    fit_nargp,
)

GRID = np.random.default_rng(8).random((40, 2))
SPREAD = 0.5


def low(x):
    return np.sin(4 * x[:, 0]) + x[:, 1]


def high(x):
    return 1.2 * low(x) + 0.3 * x[:, 1] + 2.0


MODELS = {
    "GP": lambda s: fit_averaged(s),
    "AR1": lambda s: fit_averaged(s, "matern52", Exact(low), SPREAD),
    "AR1-NARGP": lambda s: fit_averaged(s, perdikaris(2), Exact(low), SPREAD, sees_low=True),
}


def samples(n, seed=0, sd=0.01):
    rng = np.random.default_rng(seed)
    x = rng.random((n, 2))
    return Samples.of(x, high(x) + sd * rng.standard_normal(n), sd)


@pytest.fixture(params=MODELS)
def fit(request):
    return MODELS[request.param]


def test_a_noisy_point_pulls_less(fit):
    s = samples(8)
    off = s.y + np.where(np.arange(8) == 3, 1.0, 0.0)
    believed = fit(Samples.of(s.x, off, 0.01)).predict(s.x)[0][3]
    doubted = fit(Samples.of(s.x, off, np.where(np.arange(8) == 3, 2.0, 0.01))).predict(s.x)[0][3]
    assert abs(doubted - s.y[3]) < 0.5 * abs(believed - s.y[3])


def test_where_zero_lies_and_a_gp_s_unit_do_not_matter(fit):
    s = samples(7)
    mean, sd = fit(s).predict(GRID)
    scale = 1000 if fit is MODELS["GP"] else 1
    other = fit(Samples.of(s.x, scale * s.y - 5, scale * s.sd)).predict(GRID)
    np.testing.assert_allclose(other[0], scale * mean - 5, atol=1e-6 * scale)
    np.testing.assert_allclose(other[1], scale * sd, rtol=1e-4)


def wave(x):
    return np.sin(8 * np.pi * x[:, 0])


def bent(x):
    """Perdikaris et al. 2017, section 3.1: y = (x − √2) l²."""
    return (x[:, 0] - 2**0.5) * wave(x) ** 2


def test_ar1_nargp_follows_a_bent_relation_that_ar1_cannot():
    x, below = np.random.default_rng(3).random((14, 2)), Exact(wave)
    s, grid = Samples.of(x, bent(x)), np.random.default_rng(4).random((101, 2))
    off = [
        np.sqrt(np.mean((fit_averaged(s, *how).predict(grid)[0] - bent(grid)) ** 2))
        for how in ((perdikaris(2), below, 0.7, True), ("matern52", below, 0.7))
    ]
    assert off[0] < 0.25 * off[1]


def points(n, seed=0):
    x = np.random.default_rng(seed).random((n, 2))
    return Samples.of(x, np.sin(5 * x[:, 0]) + x[:, 1] ** 2 + 7.0)


def test_the_likelihood_is_that_of_one_normal_distribution():
    s = points(9)
    fitted = fit_likelihood(s, "rbf", starts=1)
    k = fitted.units.scale**2 * parse("rbf", 2).covariance(np, fitted.theta, s.x, s.x)
    k += np.exp(2 * fitted.theta[1]) * fitted.units.scale**2 * np.eye(9)
    mean = np.full(9, fitted.units.centre)
    direct = multivariate_normal(mean, k, allow_singular=True).logpdf(s.y)
    np.testing.assert_allclose(fitted.log_likelihood, direct, rtol=1e-4)


def test_many_points_are_fitted_as_likely_as_if_all_were_climbed_from_afar():
    rng = np.random.default_rng(4)
    x = rng.random((90, 2))
    s = Samples.of(x, np.sin(9 * x[:, 0]) * x[:, 1] + 0.05 * rng.standard_normal(90))
    grown, whole = fit_growing(s, (30, 60)), fit_likelihood(s)
    assert grown.log_likelihood > whole.log_likelihood - 0.1
    # The peak of a few points is not theirs.
    few = fit_likelihood(Samples.of(x[:30], s.y[:30]))
    there = at_hyperparameters(s, "rbf", few.theta, grown.units)
    assert grown.log_likelihood > there.log_likelihood + 1


def test_an_isotropic_kernel_has_one_length_scale_and_a_lower_peak():
    s = points(14)
    free, tied = (fit_likelihood(s, noise=0.1, isotropic=isotropic) for isotropic in (False, True))
    assert tied.theta[2] == tied.theta[3]
    assert free.theta[2] != free.theta[3]
    assert tied.log_likelihood < free.log_likelihood
    only_length = points(14)
    only_length.x[:, 1] = 0.5  # nothing varies along it: both find the same peak
    free, tied = (
        fit_likelihood(only_length, noise=0.1, isotropic=isotropic) for isotropic in (False, True)
    )
    np.testing.assert_allclose(tied.log_likelihood, free.log_likelihood, atol=1e-3)


def test_the_level_below_is_integrated_over():
    """By quadrature as by a great many points of it."""

    class Unsure(Exact):
        def predict(self, x):
            return self.function(x), np.full(len(x), 0.2)

    rng = np.random.default_rng(0)
    x = rng.random((12, 1))
    low = Unsure(lambda x: np.sin(6 * x[:, 0]))
    model = fit_nargp(Samples.of(x, np.sin(6 * x[:, 0]) ** 2 + x[:, 0]), low, Normalisation(0, 1))
    at = np.linspace(0.1, 0.9, 5)[:, None]
    mean, sd = model.predict(at)
    draws = low.function(at)[:, None] + 0.2 * rng.standard_normal((5, 40_000))
    wide = np.column_stack([np.repeat(at, 40_000, axis=0), draws.reshape(-1)])
    each, spread = (part.reshape(5, -1) for part in model.high.predict(wide))
    np.testing.assert_allclose(mean, each.mean(axis=1), atol=0.01)
    total = np.sqrt(np.mean(spread**2, axis=1) + np.var(each, axis=1))
    np.testing.assert_allclose(sd, total, rtol=0.02)
