"""Gaussian processes and the surrogate: textbook, limits, missing data, no recompilation."""

import numpy as np
import pytest

from planner.surrogate import gp
from planner.surrogate.ar1 import OutputPrior, fit_ar1
from planner.surrogate.kernels import KERNELS
from planner.surrogate.modal_surrogate import fit_surrogate
from planner.surrogate.training_data import TrainingData
from tests.support.compilations import compilations
from tests.support.surrogates import observed, simulated

PRIOR = OutputPrior(bias_sd=0.2, slope_sd=0.3, amplitude=0.1, nugget=0.01)


def data(n, d=2, m=3, seed=0, missing=0.0):
    rng = np.random.default_rng(seed)
    x = rng.random((n, d))
    low = np.stack([np.sin((k + 1) * x[:, 0]) + x.sum(axis=1) for k in range(m)], axis=1)
    y = 1.1 * low + 0.05 * np.cos(5 * x[:, :1]) + 0.002 * rng.standard_normal((n, m))
    y[rng.random((n, m)) < missing] = np.nan
    return TrainingData(x, y, np.full((n, m), 0.002), low)


def fit(training, **options):
    m = training.y.shape[1]
    return fit_ar1(training, (PRIOR,) * m, (PRIOR,) * m, np.zeros(m), 64, 8, **options)


@pytest.mark.parametrize("kernel", ["rbf", "matern52"])
def test_posterior_is_the_textbook_one(kernel):
    training = data(9)
    fitted = fit(training, kernel=kernel)
    rng = np.random.default_rng(3)
    xq, low = rng.random((20, 2)), rng.random((20, 3))
    base, offset = fitted.split(low)
    mean, sd = fitted.predict(xq, low)
    for j in range(3):
        means, variances = [], []
        for theta in fitted.outputs[j].theta:
            k = _covariance(
                kernel, training.x, training.low[:, j], training.x, training.low[:, j], theta
            )
            noise = training.sd[:, j] ** 2 + np.exp(2 * theta[1])
            jitter = gp.JITTERS[0] * (np.exp(2 * theta[0]) + PRIOR.bias_sd**2)
            inverse = np.linalg.inv(k + np.diag(noise + jitter))
            cross = _covariance(kernel, training.x, training.low[:, j], xq, offset[:, j], theta)
            own = _covariance(kernel, xq, offset[:, j], xq, offset[:, j], theta)
            means.append(cross.T @ inverse @ (training.y[:, j] - training.low[:, j]))
            variances.append(np.diag(own - cross.T @ inverse @ cross))
        np.testing.assert_allclose(mean[:, j] - base[:, j], np.mean(means, axis=0), atol=1e-10)
        variance = np.mean(variances, axis=0) + np.var(means, axis=0)
        np.testing.assert_allclose(sd[:, j] ** 2, variance, atol=1e-10)


def _covariance(kernel, xa, la, xb, lb, theta):
    scale = np.exp(theta[2:])
    delta = np.exp(2 * theta[0]) * KERNELS[kernel](np, xa / scale, xb / scale)
    return delta + PRIOR.bias_sd**2 + PRIOR.slope_sd**2 * np.outer(la, lb)


def test_duplicates_and_constants_work():
    training = data(4)
    twice = TrainingData(*(np.repeat(a, 3, axis=0) for a in vars(training).values()))
    assert np.isfinite(fit(twice).predict(training.x, training.low)[0]).all()
    flat = TrainingData(training.x, np.ones((4, 3)), training.sd, np.full((4, 3), np.nan))
    mean, _ = fit(flat).predict(training.x, np.full((4, 3), np.nan))
    np.testing.assert_allclose(mean, 1.0, atol=0.05)


def test_padding_changes_nothing_and_growth_compiles_nothing():
    fit(data(3))
    results = []
    with compilations() as compiled:
        for n in range(4, 16):
            fitted = fit(data(n))
            results.append(fitted.predict(data(5, seed=9).x, data(5, seed=9).low)[0])
    assert not compiled
    again = fit(data(15)).predict(data(5, seed=9).x, data(5, seed=9).low)[0]
    assert np.array_equal(results[-1], again)  # bit for bit
    small, large = data(16), data(17)
    cut = TrainingData(*(a[:16] for a in vars(large).values()))
    masked = TrainingData(large.x, np.vstack([cut.y, np.full((1, 3), np.nan)]), large.sd, large.low)
    a = fit(cut).predict(small.x, small.low)
    b = fit(masked).predict(small.x, small.low)
    np.testing.assert_allclose(a[0], b[0], atol=1e-6)
    np.testing.assert_allclose(a[1], b[1], rtol=1e-4)


def test_frequencies_and_damping_stay_positive():
    p = fit_surrogate(observed(2, 0)).predict(
        np.full((3, 2), 40.0), simulated(np.full((3, 2), 0.5))
    )
    assert (p.frequency_hz > 0).all()
    assert (p.damping_ratio > 0).all()
