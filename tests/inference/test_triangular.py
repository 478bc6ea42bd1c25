"""Triangular matrices give what whole ones give."""

import numpy as np
import pytest

from planner.inference import triangular


@pytest.mark.parametrize("size", [3, triangular.BAND, 2 * triangular.BAND + 7])
def test_inverse_and_product(size):
    rng = np.random.default_rng(1)
    half = rng.standard_normal((2, size, size))
    lower = np.linalg.cholesky(half @ np.swapaxes(half, 1, 2) + size * np.eye(size))
    columns = rng.standard_normal((2, size, 5))
    product = triangular.times(lower, columns)
    assert product == pytest.approx(lower @ columns)
    back = np.array([triangular.inverse(one) for one in lower]) @ product
    assert back == pytest.approx(columns)
