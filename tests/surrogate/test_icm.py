"""One GP of many tasks: Kronecker's structure against a direct Cholesky factor, what it gains."""

import numpy as np
import pytest
from scipy.linalg import cho_factor, cho_solve
from scipy.stats import multivariate_normal

from planner.errors import InputError
from planner.surrogate.kernels import parse
from planner.surrogate.models.multitask import (
    RANK,
    Hyperparameters,
    Tasks,
    fit_multitask,
    log_density,
    solve,
)


def related(n, m, seed=0, noise=0.05):
    """m outputs that are sums of two smooth functions, with noise."""
    rng = np.random.default_rng(seed)
    x = rng.random((n, 2))
    smooth = np.column_stack([np.sin(4 * x[:, 0]), np.cos(3 * x[:, 1]) * x[:, 0]])
    mixed = rng.standard_normal((2, m))
    return x, smooth @ mixed + noise * rng.standard_normal((n, m)), mixed


def hyperparameters(m, seed=1):
    rng = np.random.default_rng(seed)
    return Hyperparameters(
        rng.standard_normal((m, 2)), rng.normal(-1, 0.3, m), rng.normal(-1, 0.3, m),
        np.array([0.0, -2.0, -0.5, -0.3]),
    )  # fmt: skip


def dense(data, h):
    """B ⊗ K_x + D of outputs task by task."""
    k = parse("rbf", 2).covariance(np, h.theta, data.x, data.x)
    k = k + 1e-9 * np.mean(np.diag(k)) * np.eye(len(k))
    return np.kron(h.task_covariance, k) + np.kron(np.diag(np.exp(2 * h.log_noise)), np.eye(len(k)))


def test_144_tasks_are_solved_as_a_direct_cholesky_factor_solves_them():
    x, y, _ = related(10, 144)
    data, h = Tasks.of(x, y), hyperparameters(144)
    solved, full = solve(data, h), dense(data, h)
    alpha = cho_solve(cho_factor(full, lower=True), data.y.T.ravel()).reshape(144, 10).T
    np.testing.assert_allclose(solved.alpha, alpha, rtol=1e-6, atol=1e-8)
    root = np.linalg.cholesky(full)
    white = np.linalg.solve(root, data.y.T.ravel())
    direct = -0.5 * white @ white - np.log(np.diag(root)).sum() - 720 * np.log(2 * np.pi)
    np.testing.assert_allclose(solved.value, direct, rtol=1e-9)


def test_slopes_agree_with_finite_differences():
    x, y, _ = related(9, 5)
    data, h = Tasks.of(x, y), hyperparameters(5)
    _, slope = log_density(data, h)
    rng, vector = np.random.default_rng(3), h.flat()
    for _ in range(4):
        way = rng.standard_normal(len(vector)) * (np.arange(len(vector)) != len(vector) - 3)
        ends = [log_density(data, h.like(vector + s * way))[0] for s in (1e-5, -1e-5)]
        np.testing.assert_allclose(slope @ way, (ends[0] - ends[1]) / 2e-5, rtol=1e-4)


def test_predictions_are_those_of_the_dense_gp():
    x, y, _ = related(10, 4)
    fitted, there = fit_multitask(x, y, rank=2), np.random.default_rng(5).random((6, 2))
    h, data = fitted.hyperparameters, fitted.tasks
    cross = parse("rbf", 2).covariance(np, h.theta, there, x)
    wide = np.kron(h.task_covariance, cross)
    full = dense(data, h)
    mean = (wide @ np.linalg.solve(full, data.y.T.ravel())).reshape(4, 6).T
    own = np.repeat(np.diag(h.task_covariance), 6)
    variance = (own - np.einsum("ij,ji->i", wide, np.linalg.solve(full, wide.T))).reshape(4, 6).T
    told = fitted.predict(there)
    np.testing.assert_allclose(told[0], data.centre + data.scale * mean, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(told[1], data.scale * np.sqrt(variance), rtol=1e-4)
    value = multivariate_normal(np.zeros(40), full).logpdf(data.y.T.ravel())
    np.testing.assert_allclose(fitted.solved.value, value, rtol=1e-8)


def test_many_tasks_tell_more_than_each_alone():
    x, y, mixed = related(20, 40, noise=0.4)
    there = np.random.default_rng(6).random((50, 2))
    true = np.column_stack([np.sin(4 * there[:, 0]), np.cos(3 * there[:, 1]) * there[:, 0]]) @ mixed
    together = fit_multitask(x, y, rank=RANK).predict(there)[0][:, :8]
    alone = np.column_stack([fit_multitask(x, y[:, [i]]).predict(there)[0] for i in range(8)])
    off = [np.sqrt(np.mean((mean - true[:, :8]) ** 2)) for mean in (together, alone)]
    assert off[0] < 0.8 * off[1]


def test_a_missing_value_is_no_input():
    x, y, _ = related(9, 3)
    y[2, 1] = np.nan
    with pytest.raises(InputError, match="Output 2"):
        fit_multitask(x, y, rank=RANK)
