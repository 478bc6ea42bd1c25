"""What the weights must do whatever the robot."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from planner.diagnose.weigh import shared_noise, temper


@given(st.floats(0.5, 1e6), st.floats(1.0, 10.0))
def test_temper_grows_with_the_misfit(misfit, shared):
    assert temper(misfit, shared) >= min(misfit, 1.0) * shared
    assert temper(1.1 * misfit, shared) >= temper(misfit, shared)


@given(st.floats(0.05, 2.0), st.floats(0.1, 5.0))
def test_shared_noise_is_the_sum_over_lags(spacing_hz, rate_1_s):
    lag = np.arange(-200_000, 200_001)
    a = 2 * np.pi * spacing_hz / (2 * rate_1_s)
    direct = np.sum(1 / (1 + (a * lag) ** 2))
    assert abs(shared_noise(spacing_hz, rate_1_s) / direct - 1) < 1e-2
    assert shared_noise(spacing_hz, 0.0) == 1.0
