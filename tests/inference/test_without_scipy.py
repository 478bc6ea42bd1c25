"""Small functions that are SciPy's or NumPy's too; commands between two hits do without SciPy."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment
from scipy.special import logsumexp, softmax
from scipy.stats import ortho_group

from planner.inference import triangular
from planner.inference.assignment import least_cost
from planner.inference.covariance import covariance_root, eigen, inverse
from planner.inference.log_space import log_sum, shares


def test_they_give_what_scipy_gives():
    rng = np.random.default_rng(3)
    values = rng.normal(0, 300, (4, 5, 6))
    values[1, 2], values[2, :, 3] = -np.inf, -np.inf
    for axis in (1, 2):
        assert log_sum(values, axis) == pytest.approx(logsumexp(values, axis=axis), rel=1e-14)
    finite = rng.normal(0, 300, (4, 5))
    assert shares(finite, 1) == pytest.approx(softmax(finite, axis=1), rel=1e-12)


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


def test_inverse_of_a_precision():
    rng = np.random.default_rng(0)
    root = rng.standard_normal((12, 12))
    precision = root @ root.T + np.eye(12)
    np.testing.assert_allclose(inverse(precision) @ precision, np.eye(12), atol=1e-12)


def test_a_root_hangs_on_no_sign_of_an_eigenvector():
    """What is drawn with it is the same wherever the arrays lie: in another order, too."""
    rng = np.random.default_rng(1)
    matrix, order = np.cov(rng.standard_normal((12, 40))), rng.permutation(12)
    there = covariance_root(matrix[np.ix_(order, order)])
    np.testing.assert_allclose(there, covariance_root(matrix)[np.ix_(order, order)], atol=1e-13)


def test_eigenvalues_where_divide_and_conquer_does_not_converge(monkeypatch):
    def fails(matrix):
        raise np.linalg.LinAlgError("Eigenvalues did not converge")

    matrix = np.cov(np.random.default_rng(0).standard_normal((12, 40)))
    there = covariance_root(matrix)
    monkeypatch.setattr(np.linalg, "eigh", fails)
    for root in (there, covariance_root(matrix)):
        np.testing.assert_allclose(root @ root.T, matrix, atol=1e-13)
    values, vectors = eigen(np.stack([matrix, 2 * matrix]))
    np.testing.assert_allclose(values[1], 2 * values[0])
    np.testing.assert_allclose(vectors[0] * values[0] @ vectors[0].T, matrix, atol=1e-13)
    with pytest.raises(np.linalg.LinAlgError):
        eigen(np.full((2, 2), np.nan))


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


@pytest.mark.parametrize("size", [3, triangular.BLOCK, 4 * triangular.BLOCK + 7])
def test_inverse_of_a_triangle(size):
    half = np.random.default_rng(1).standard_normal((size, size))
    lower = np.linalg.cholesky(half @ half.T + size * np.eye(size))
    assert lower @ triangular.inverse(lower) == pytest.approx(np.eye(size))


@pytest.mark.parametrize(
    ("does", "without"),
    [
        (
            "planner.cli.app, planner.campaign.importing, planner.campaign.build, "
            "planner.report.status, planner.report.imports, planner.campaign.proposals, "
            "planner.modal.estimate_modes",
            ("scipy", "jax", "matplotlib"),
        ),
        (
            "planner.cli.app, planner.campaign.campaign, planner.report.status",
            ("scipy", "jax", "pinocchio"),
        ),
    ],
    ids=["commands between hits", "status of what is kept"],
)
def test_commands_do_not_load_what_takes_seconds(does, without):
    code = f"import sys, {does}\nprint([m for m in sys.modules if m.startswith({without})])"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"
