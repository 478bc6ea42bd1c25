"""Leave-one-out against refits, calibration, and a measurement gone wrong."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from planner.campaign.model_status import left_out
from planner.surrogate.ar1 import OutputPrior, fit_ar1
from planner.surrogate.leave_one_out import leave_one_out, report
from planner.surrogate.training_data import TrainingData

PRIOR = OutputPrior(bias_sd=0.5, slope_sd=0.5, amplitude=0.3, nugget=0.02)


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
    return fit_ar1(training, (PRIOR,), (PRIOR,), np.zeros(1))


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
