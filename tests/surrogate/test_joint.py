"""AR1 in its joint form against the recursive one, level by level, at the same hyperparameters."""

from dataclasses import replace

import numpy as np
import pytest

from planner.surrogate.ar1 import AR1
from planner.surrogate.gp import Posterior
from planner.surrogate.gp import fit as fit_posterior
from planner.surrogate.models.averaged import AveragedModel
from planner.surrogate.models.fidelity_levels import FidelityLevel, Samples
from planner.surrogate.training_data import Prior, TrainingData, pad
from tests.support.joint_ar1 import Hyperparameters, condition_joint

RNG = np.random.default_rng(4)
LOW, HIGH, GRID = RNG.random((30, 2)), 8, RNG.random((50, 2))
H = Hyperparameters(
    "rbf", np.array([0.1, -9.0, -0.7, -0.5]), "matern52", np.array([-1.5, -8.0, -0.3, 0.2]), 1.3
)


def low(x):
    return np.sin(4 * x[:, 0]) + x[:, 1]


def high(x):
    return 1.3 * low(x) + 0.3 * x[:, 1] ** 2 + 0.5


def pinned(x, y, theta, kernel, base, slope_sd, bias_sd):
    """A posterior whose hyperparameters are certain."""
    nothing = np.full((len(x), 1), np.nan)
    data = TrainingData(x, y[:, None], 0 * y[:, None], nothing if base is None else base[:, None])
    prior = Prior(
        np.zeros(1), np.full(1, bias_sd), np.full(1, slope_sd), theta[None], np.full((1, 4), 1e-9)
    )
    return fit_posterior(pad(data, np.array([base is not None])), prior, 16, 2, kernel)


def recursive(h: Hyperparameters) -> AveragedModel:
    y = low(LOW)
    one = np.zeros(1)
    own = pinned(LOW, y, h.low_theta, h.low_kernel, None, 0.0, h.low_bias_sd)
    alone = AR1(own, np.array([False]), one, one)
    below = AveragedModel(None, alone, 0.0, 1.0, 0.0, 1.0, 0.0)
    x = LOW[:HIGH]
    rest = high(x) - h.slope * y[:HIGH]
    posterior = pinned(x, rest, h.delta_theta, h.delta_kernel, 0 * rest, 0.0, h.bias_sd)
    model = AR1(posterior, np.array([True]), one, one)
    return AveragedModel(Scaled(below, h.slope), model, 0.0, 1.0, 0.0, 1.0, 0.0)


class Scaled(FidelityLevel):
    """ρ times a level."""

    def __init__(self, level, slope):
        self.level, self.slope = level, slope

    def predict(self, x):
        mean, sd = self.level.predict(x)
        return self.slope * mean, self.slope * sd


def joint(h: Hyperparameters, count=HIGH):
    x = LOW[:count]
    return condition_joint(Samples.of(LOW, low(LOW)), Samples.of(x, high(x)), h)


def test_where_cheap_points_include_the_expensive_ones_both_forms_agree():
    mean, sd = recursive(H).predict(GRID)
    other, other_sd = joint(H).predict(GRID)
    np.testing.assert_allclose(mean, other, atol=1e-3)
    np.testing.assert_allclose(sd, other_sd, rtol=0.01, atol=1e-3)


def test_evidence_of_the_joint_form_is_that_of_both_levels_one_after_the_other():
    below = pinned(LOW, low(LOW), H.low_theta, H.low_kernel, None, 0.0, H.low_bias_sd)
    assert isinstance(below, Posterior)
    rest = high(LOW[:HIGH]) - H.slope * low(LOW[:HIGH])
    delta = pinned(LOW[:HIGH], rest, H.delta_theta, H.delta_kernel, 0 * rest, 0.0, H.bias_sd)
    both = below.log_evidence[0] + delta.log_evidence[0]
    # The recursive form takes the cheap value as it is, the joint one doubts it by its nugget.
    assert joint(H).log_evidence == pytest.approx(both, abs=0.5)


def test_without_a_slope_it_is_a_gp_of_the_expensive_samples():
    alone = replace(H, slope=0.0)
    posterior = pinned(
        LOW[:HIGH], high(LOW[:HIGH]), H.delta_theta, H.delta_kernel, None, 0.0, H.bias_sd
    )
    mean, sd = posterior.predict(GRID, np.zeros((len(GRID), 1)))
    other, other_sd = joint(alone).predict(GRID)
    np.testing.assert_allclose(mean[:, 0], other, atol=1e-6)
    np.testing.assert_allclose(sd[:, 0], other_sd, atol=1e-6)
