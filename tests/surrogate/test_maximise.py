"""The peak of a log density: bounds hold, infeasible points are stepped back from, starts vie."""

import numpy as np
import pytest

from planner.surrogate.likelihood import maximise


def gaussian(middle: np.ndarray, sd: np.ndarray):
    def log_density(x: np.ndarray) -> tuple[float, np.ndarray]:
        off = (x - middle) / sd
        return -0.5 * float(off @ off), -off / sd

    return log_density


def test_peak_of_a_gaussian_within_bounds_of_each_entry():
    density = gaussian(np.array([0.5, 3.0, 3.0]), np.array([1.0, 0.1, 3.0]))
    high = np.array([4.0, 1.0, 9.0])
    peak = maximise(density, [np.zeros(3)], -np.ones(3), high)
    np.testing.assert_allclose(peak.x, [0.5, 1.0, 3.0], atol=1e-4)
    assert peak.log_density == pytest.approx(-0.5 * 20**2, rel=1e-6)
    assert maximise(density, [np.zeros(3)], -np.ones(3), high, most_steps=1).log_density < -201


def test_the_higher_of_two_peaks_is_taken():
    left, right = gaussian(np.array([-2.0]), np.ones(1)), gaussian(np.array([2.0]), np.ones(1))

    def log_density(x: np.ndarray) -> tuple[float, np.ndarray]:
        if x[0] < 0:
            return left(x)
        value, slope = right(x)
        return value + 1.0, slope

    for starts in ([-3.0, 3.0], [3.0, -3.0]):
        peak = maximise(log_density, [np.array([s]) for s in starts], -4.0, 4.0)
        assert peak.x[0] == pytest.approx(2.0, abs=1e-4)
        assert peak.log_density == pytest.approx(1.0)


def test_infeasible_points_are_stepped_back_from():
    def log_density(x: np.ndarray) -> tuple[float, np.ndarray]:
        # x − log x: its first long step from 5 leads below zero, where there is no logarithm.
        if x[0] <= 0:
            return np.nan, np.array([np.nan])
        return 20 * (np.log(x[0]) - x[0]), 20 * (1 / x - 1)

    peak = maximise(log_density, [np.array([5.0])], -100.0, 100.0)
    assert peak.x[0] == pytest.approx(1.0, abs=1e-4)


def test_nothing_finite_gives_the_first_start():
    starts = [np.array([1.0]), np.array([2.0])]
    peak = maximise(lambda x: (-np.inf, np.zeros(1)), starts, -4.0, 4.0)
    assert peak.x[0] == 1.0
    assert peak.log_density == -np.inf
