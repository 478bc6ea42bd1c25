"""Of many poses, hyperparameters are sampled in stages; predictions stay what they were."""

import pickle

import numpy as np

from planner.surrogate import gp
from planner.surrogate.ar1 import OutputPrior, fit_ar1
from planner.surrogate.training_data import TrainingData, pad, thinned

PRIOR = OutputPrior(bias_sd=0.2, slope_sd=0.3, amplitude=0.1, nugget=0.01)
NOISE = 0.01


def low(x):
    return np.sin(2 * x[:, :1]) + x.sum(axis=1, keepdims=True)


def true(x):
    return 1.1 * low(x) + 0.05 * np.cos(5 * x[:, :1]) * x[:, 1:]


def measured(n, seed, columns=1):
    rng = np.random.default_rng(seed)
    x = rng.random((n, 2))
    y = true(x) + NOISE * rng.standard_normal((n, columns))
    return TrainingData(x, y, np.full(y.shape, NOISE), np.repeat(low(x), columns, axis=1))


def fit(data, samples=256, kept=32):
    m = data.y.shape[1]
    return fit_ar1(data, (PRIOR,) * m, (PRIOR,) * m, np.zeros(m), samples, kept)


def test_stages_say_what_all_points_at_once_say(monkeypatch):
    """Differences are of the size of those between two sets of samples of all points."""
    data, x = measured(90, 1), np.random.default_rng(2).random((60, 2))
    staged = fit(data)
    monkeypatch.setattr(gp, "AT_ONCE", len(data.x) * 10)
    whole = fit(data)
    (mean, sd), (other, other_sd) = (f.predict(x, low(x)) for f in (staged, whole))
    assert np.sqrt(np.mean(((mean - other) / other_sd) ** 2)) < 0.2
    assert abs(np.mean(np.log(sd / other_sd))) < 0.15
    assert abs(staged.log_evidence - whole.log_evidence).item() < 1.0


def test_an_output_measured_at_few_poses_keeps_them_all():
    data = measured(200, 5, columns=2)
    rare = np.arange(0, 200, 10)
    y = data.y.copy()
    y[np.setdiff1d(np.arange(200), rare), 1] = np.nan
    padded = pad(TrainingData(data.x, y, data.sd, data.low), np.ones(2, bool))
    part = thinned(padded, 32)
    assert part.mask.sum(axis=1).tolist() == [32, len(rare)]
    kept = part.x[1][part.mask[1] > 0]
    np.testing.assert_array_equal(kept, data.x[rare])
    assert np.ptp([np.flatnonzero((data.x == row).all(axis=1))[0] for row in part.x[0]]) == 199


def test_large_matrices_are_worked_out_again_with_the_same_digits():
    fitted, x = fit(measured(150, 6)), np.random.default_rng(7).random((20, 2))
    said = fitted.predict(x, low(x))
    data = pickle.dumps(fitted)
    assert len(data) < 1_000_000
    for a, b in zip(said, pickle.loads(data).predict(x, low(x)), strict=True):
        np.testing.assert_array_equal(a, b)
