"""Slopes that optimisers follow, jitter that is told, models that become simpler, leave-one-out."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from planner.campaign.model_status import left_out
from planner.surrogate import gp, likelihood
from planner.surrogate.ar1 import FusionData, OutputPrior, fit_ar1
from planner.surrogate.average import fit_hedged, fit_shapes
from planner.surrogate.kernels import parse
from planner.surrogate.leave_one_out import leave_one_out, report
from planner.surrogate.training_data import TrainingData

GRID = np.random.default_rng(8).random((30, 2))
PRIOR = OutputPrior(bias_sd=0.5, slope_sd=0.5, amplitude=0.3, nugget=0.02)


def given(values, centre=np.nan, prior=PRIOR):
    m = values.y.shape[1]
    return FusionData(values, (prior,) * m, (prior,) * m, np.full(m, centre))


def samples(n, seed=0):
    rng = np.random.default_rng(seed)
    x = rng.random((n, 2))
    return x, np.sin(4 * x[:, :1]) + 0.02 * rng.standard_normal((n, 1))


def training(n, seed=0):
    x, y = samples(n, seed)
    return TrainingData(x, y, np.full((n, 1), 0.02), np.full((n, 1), np.nan))


@pytest.mark.parametrize(
    "kernel", ["matern52+bias", "rbf+quadratic*cubic", "rbf[0:1]*rbf[1:2]+linear"]
)
def test_slope_of_the_likelihood_of_the_hyperparameters_agrees_with_finite_differences(kernel):
    """The density that is climbed, with gaps, noise and a marginalised slope."""
    rng = np.random.default_rng(0)
    p, n = parse(kernel, 2).size, 9
    low = rng.standard_normal(n)
    mask = (np.arange(n) != 4).astype(float)
    x, y, at = rng.random((n, 2)), rng.standard_normal(n) * mask, 0.3 * rng.standard_normal(p) - 0.5
    data = 1e-12, x, y, low, mask, np.full(n, 0.01), 0.4, 0.7
    _, slope = likelihood.log_likelihood(kernel, at, *data)
    for i, unit in enumerate(1e-5 * np.eye(p)):
        ends = [float(likelihood.log_likelihood(kernel, at + s * unit, *data)[0]) for s in (1, -1)]
        assert float(slope[i]) == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-4, abs=1e-5)


def test_jitter_that_was_needed_is_told(monkeypatch):
    monkeypatch.setattr(gp, "JITTERS", (0.0, 1e-7))
    x = np.repeat(samples(1)[0], 3, axis=0)
    data = TrainingData(x, np.ones((3, 1)), np.zeros((3, 1)), np.full((3, 1), np.nan))
    certain = OutputPrior(bias_sd=0.5, slope_sd=0.0, amplitude=0.3, nugget=1e-12, spread=1e-9)
    fitted = fit_ar1(given(data, prior=certain))
    assert gp.remarks(fitted.outputs) == (gp.SINGULAR_REMARK.format(1e-7),)
    plain = fit_ar1(given(training(4)))
    assert gp.remarks(plain.outputs) == ()


def test_what_the_kernels_are_averaged_over_follows_the_data():
    kernels = ("bias", "cubic", "matern52")
    x = np.random.default_rng(1).random((20, 2))
    noise = 0.02 * np.random.default_rng(2).standard_normal((20, 2))
    y = np.stack([np.full(20, 0.3), np.sin(7 * x[:, 0])], axis=1) + noise
    data = TrainingData(x, y, np.full((20, 2), 0.02), np.full((20, 2), np.nan))
    found = fit_shapes(given(data), kernels)
    best = [kernels[i] for i in np.argmax(found.weights, axis=0)]
    assert best == ["bias", "matern52"]
    np.testing.assert_allclose(found.weights.sum(axis=0), 1)
    mean, sd = found.predict(GRID, np.full((30, 2), np.nan))
    assert np.abs(mean[:, 0] - 0.3).max() < 0.05
    assert sd[:, 0].max() < 0.05


def test_without_a_simulation_the_hedge_is_a_gp():
    data, low = given(training(7)), np.full((30, 1), np.nan)
    hedged, plain = (fit(data).predict(GRID, low) for fit in (fit_hedged, fit_ar1))
    np.testing.assert_allclose(hedged, plain, atol=1e-12)


def low(x):
    return np.cos(2 * x[:, :1]) + x[:, 1:]


def data(n, seed=0, wrong=None):
    rng = np.random.default_rng(seed)
    x = rng.random((n, 2))
    y = 1.1 * low(x) + 0.2 * np.sin(5 * x[:, :1]) + 0.02 * rng.standard_normal((n, 1))
    if wrong is not None:
        y[wrong] += 1.0
    return TrainingData(x, y, np.full((n, 1), 0.005), low(x))


def fit(training):
    return fit_ar1(given(training, 0.0))


def test_it_is_what_refits_without_the_measurement_say():
    training = data(9)
    found = leave_one_out(fit(training).outputs, 9)
    for i in range(9):
        rest = TrainingData(*(np.delete(a, i, axis=0) for a in vars(training).values()))
        model = fit(rest)
        mean, sd = model.predict(training.x[i : i + 1], training.low[i : i + 1])
        noise = np.sqrt(model.outputs[0].nugget_variance + 0.005**2)
        assert abs(training.y[i, 0] - mean[0, 0] - found.error[i, 0]) < 0.25 * np.hypot(sd, noise)
        assert 0.6 < found.sd[i, 0] / np.hypot(sd[0, 0], noise) < 1.6


def test_a_wrong_measurement_is_named():
    found = leave_one_out(fit(data(15, wrong=4)).outputs, 15)
    assert found.worst(1).tolist() == [4]
    lines = report(found, tuple(f"P{i:03d}" for i in range(15)), ("mode 1",))
    assert any(line.startswith("P004: mode 1 is") for line in lines)


def test_gaps_and_nothing_at_all():
    training = data(5)
    training.y[2] = np.nan
    found = leave_one_out(fit(training).outputs, 5)
    assert np.isnan(found.error[2]).all()
    assert np.isfinite(np.delete(found.sd, 2, axis=0)).all()
    none = TrainingData(*(a[:0] for a in vars(training).values()))
    assert "too few" in report(leave_one_out(fit(none).outputs, 0), (), ("mode 1",))[0]


def test_frequencies_told_by_the_simulations_shapes_stand_beside_their_own_predictions():
    """No modal analysis found the mode, which the model has nonetheless."""
    training = data(9)
    outputs = fit(training).outputs
    average = SimpleNamespace(most_probable=SimpleNamespace(outputs=outputs))
    model: Any = SimpleNamespace(
        surrogate=SimpleNamespace(primary=average, count=1),
        labelled=tuple(SimpleNamespace(pose=f"P{i}", modes=(None,)) for i in range(9)),
        seen=SimpleNamespace(frequency_hz=np.exp(training.y)),
    )
    rows, error = left_out(model).frequencies, leave_one_out(outputs, 9).error
    np.testing.assert_allclose([r.measured_hz for r in rows], np.exp(training.y[:, 0]))
    np.testing.assert_allclose([r.predicted_hz for r in rows], np.exp((training.y - error)[:, 0]))
