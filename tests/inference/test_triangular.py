"""Triangular matrices give what whole ones give."""

import numpy as np
import pytest

from planner.inference import triangular


@pytest.mark.parametrize("size", [3, triangular.BAND, 2 * triangular.BAND + 7])
def test_division_and_inverse(size):
    rng = np.random.default_rng(1)
    half = rng.standard_normal((2, size, size))
    lower = np.linalg.cholesky(half @ np.swapaxes(half, 1, 2) + size * np.eye(size))
    columns = rng.standard_normal((2, size, 5))
    bands = triangular.in_bands(lower)
    white = triangular.divided(bands, columns)
    assert lower @ white == pytest.approx(columns)
    back = triangular.divided_by_transposed(bands, white)
    assert np.swapaxes(lower, 1, 2) @ back == pytest.approx(white)
    assert triangular.inverses(bands) @ columns == pytest.approx(white)
    assert np.array([triangular.inverse(one) for one in lower]) @ columns == pytest.approx(white)


def test_the_first_rows_alone_are_divided_by_too():
    size, few = 2 * triangular.BAND + 7, triangular.BAND + 40
    rng = np.random.default_rng(2)
    half = rng.standard_normal((1, size, size))
    lower = np.linalg.cholesky(half @ np.swapaxes(half, 1, 2) + size * np.eye(size))
    columns = rng.standard_normal((1, few, 3))
    bands = triangular.in_bands(lower)[:, :few, :few]
    assert lower[:, :few, :few] @ triangular.divided(bands, columns) == pytest.approx(columns)
