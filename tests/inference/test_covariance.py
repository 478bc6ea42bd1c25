"""The solver's covariance stays one where precisions differ by many decades."""

import numpy as np
from scipy.stats import ortho_group

from planner.inference.covariance import inverse


def test_inverse_of_a_precision():
    rng = np.random.default_rng(0)
    root = rng.standard_normal((12, 12))
    precision = root @ root.T + np.eye(12)
    np.testing.assert_allclose(inverse(precision) @ precision, np.eye(12), atol=1e-12)


def test_no_variance_is_negative_where_a_barrier_stands_close():
    size = 60
    vectors = ortho_group.rvs(size, random_state=1)
    values = np.logspace(0, 22, size)
    precision = (vectors * values) @ vectors.T
    precision = (precision + precision.T) / 2
    covariance = inverse(precision)
    assert (np.diagonal(covariance) > 0).all()
    assert np.linalg.eigvalsh(covariance).min() > -1e-9 * np.abs(covariance).max()
    # A plain inverse fails here, which is why there is another.
    assert (np.diagonal(np.linalg.inv(precision)) < 0).any()
