"""Triangular matrices give what whole ones give."""

import numpy as np
import pytest

from planner.inference import triangular


@pytest.mark.parametrize("size", [3, triangular.BLOCK, 4 * triangular.BLOCK + 7])
def test_inverse(size):
    half = np.random.default_rng(1).standard_normal((size, size))
    lower = np.linalg.cholesky(half @ half.T + size * np.eye(size))
    assert lower @ triangular.inverse(lower) == pytest.approx(np.eye(size))
