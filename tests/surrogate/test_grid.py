"""GP over a grid: the dense one, and ten thousand points."""

import time

import numpy as np
import pytest

from planner.surrogate.kernels import parse
from planner.surrogate.models.grid_gp import fit_grid


def surface(a, b):
    return np.sin(6 * a[:, None]) * np.cos(3 * b[None, :]) + b[None, :]


def pairs(a, b):
    return np.column_stack([np.repeat(a, len(b)), np.tile(b, len(a))])


def test_it_is_the_dense_gp():
    a, b = np.linspace(0, 1, 7), np.linspace(0, 1, 5)
    y = surface(a, b) + 0.05 * np.random.default_rng(0).standard_normal((7, 5))
    fitted = fit_grid(a, b, y)
    points, query = pairs(a, b), np.random.default_rng(1).random((9, 2))

    def cov(p, q):
        ka = parse("rbf", 1).covariance(np, fitted.theta_a, p[:, :1], q[:, :1])
        return ka * parse("rbf", 1).covariance(np, fitted.theta_b, p[:, 1:], q[:, 1:])

    k = cov(points, points) + np.exp(2 * fitted.theta_a[1]) * np.eye(35)
    cross = cov(points, query)
    scaled = (y.reshape(-1) - fitted.centre) / fitted.scale
    mean, sd = fitted.predict(query)
    np.testing.assert_allclose(
        (mean - fitted.centre) / fitted.scale, cross.T @ np.linalg.solve(k, scaled), atol=1e-5
    )
    variance = np.diag(cov(query, query) - cross.T @ np.linalg.solve(k, cross))
    np.testing.assert_allclose((sd / fitted.scale) ** 2, variance, atol=1e-5)
    dense = -0.5 * (scaled @ np.linalg.solve(k, scaled) + np.linalg.slogdet(2 * np.pi * k)[1])
    assert fitted.log_evidence + 35 * np.log(fitted.scale) == pytest.approx(dense, rel=1e-4)


def test_twelve_thousand_points_take_seconds():
    a, b = np.linspace(0, 1, 251), np.linspace(0, 1, 51)
    y = surface(a, b) + 0.02 * np.random.default_rng(0).standard_normal((251, 51))
    start = time.process_time()
    fitted = fit_grid(a, b, y)
    spent = time.process_time() - start
    print(f"12,801 points: {spent:.2f} s of processor")
    query = np.random.default_rng(1).random((200, 2))
    mean, sd = fitted.predict(query)
    truth = np.sin(6 * query[:, 0]) * np.cos(3 * query[:, 1]) + query[:, 1]
    assert np.sqrt(np.mean((mean - truth) ** 2)) < 0.005
    assert np.mean(np.abs(mean - truth) < 1.96 * sd) > 0.85
    assert spent < 20
