"""Pairs of least cost: the same as SciPy's, whether rows compete for a column or not."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from planner.inference.assignment import least_cost


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (2, 6), (4, 4), (6, 3)])
def test_pairs_are_those_of_scipy(rows, columns):
    rng = np.random.default_rng(rows + 10 * columns)
    for cost in rng.standard_normal((50, rows, columns)):
        np.testing.assert_array_equal(least_cost(cost), linear_sum_assignment(cost))


def test_ties_are_left_to_scipy():
    tied = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [2.0, 2.0, 2.0]])
    np.testing.assert_array_equal(least_cost(tied), linear_sum_assignment(tied))


def test_without_columns_nothing_is_paired():
    assert [len(part) for part in least_cost(np.zeros((3, 0)))] == [0, 0]
