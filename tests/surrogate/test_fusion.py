"""Gaussian processes: textbook, limits, missing data, no recompilation, many poses in stages."""

import pickle

import numpy as np
import pytest

from planner.surrogate import gp
from planner.surrogate.ar1 import FusionData, OutputPrior, fit_ar1
from planner.surrogate.kernels import KERNELS
from planner.surrogate.modal_surrogate import fit_surrogate
from planner.surrogate.training_data import TrainingData, pad, thinned
from tests.support.compilations import compilations
from tests.support.surrogates import observed, simulated

PRIOR = OutputPrior(bias_sd=0.2, slope_sd=0.3, amplitude=0.1, nugget=0.01)


def low_of(x, m=3):
    return np.stack([np.sin((k + 1) * x[:, 0]) + x.sum(axis=1) for k in range(m)], axis=1)


def data(n, m=3, seed=0, noise=0.002):
    rng = np.random.default_rng(seed)
    x = rng.random((n, 2))
    low = low_of(x, m)
    y = 1.1 * low + 0.05 * np.cos(5 * x[:, :1]) + noise * rng.standard_normal((n, m))
    return TrainingData(x, y, np.full((n, m), noise), low)


def fit(training, samples=64, kept=8, **options):
    m = training.y.shape[1]
    given = FusionData(training, (PRIOR,) * m, (PRIOR,) * m, np.zeros(m))
    return fit_ar1(given, samples, kept, **options)


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


def test_stages_say_what_all_points_at_once_say(monkeypatch):
    """Differences are of the size of those between two sets of samples of all points."""
    training, x = data(90, 1, 1, 0.01), np.random.default_rng(2).random((60, 2))
    staged = fit(training, 256, 32)
    monkeypatch.setattr(gp, "AT_ONCE", len(training.x) * 10)
    whole = fit(training, 256, 32)
    (mean, sd), (other, other_sd) = (f.predict(x, low_of(x, 1)) for f in (staged, whole))
    assert np.sqrt(np.mean(((mean - other) / other_sd) ** 2)) < 0.2
    assert abs(np.mean(np.log(sd / other_sd))) < 0.15
    assert abs(staged.log_evidence - whole.log_evidence).item() < 1.0


def test_an_output_measured_at_few_poses_keeps_them_all():
    training = data(200, 2, 5, 0.01)
    rare = np.arange(0, 200, 10)
    y = training.y.copy()
    y[np.setdiff1d(np.arange(200), rare), 1] = np.nan
    padded = pad(TrainingData(training.x, y, training.sd, training.low), np.ones(2, bool))
    part = thinned(padded, 32)
    assert part.mask.sum(axis=1).tolist() == [32, len(rare)]
    kept = part.x[1][part.mask[1] > 0]
    np.testing.assert_array_equal(kept, training.x[rare])
    assert np.ptp([np.flatnonzero((training.x == row).all(axis=1))[0] for row in part.x[0]]) == 199


def test_large_matrices_are_worked_out_again_with_the_same_digits():
    fitted, x = fit(data(150, 1, 6, 0.01), 256, 32), np.random.default_rng(7).random((20, 2))
    said = fitted.predict(x, low_of(x, 1))
    kept = pickle.dumps(fitted)
    assert len(kept) < 1_000_000
    for a, b in zip(said, pickle.loads(kept).predict(x, low_of(x, 1)), strict=True):
        np.testing.assert_array_equal(a, b)
