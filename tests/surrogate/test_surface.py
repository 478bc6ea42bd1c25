"""FRF-level fusion on a surface, the GP over a grid; multi-task GPs: Kronecker equals dense.

`pytest -m slow tests/surrogate/test_surface.py` adds MFDGP.
"""

import time

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from planner.errors import InputError
from planner.surrogate.kernels import parse
from planner.surrogate.models.frf_surface import Grid, fit_grid, fit_surface
from planner.surrogate.models.mfdgp import Training
from planner.surrogate.models.multitask import (
    RANK,
    Hyperparameters,
    Tasks,
    fit_multitask,
    log_density,
    solve,
)

LINES, POSES = np.linspace(5, 30, 20), np.linspace(0, 1, 9)
QUICK = Training(300, 300, inducing=30)


def simulated(lines, poses):
    natural = 12 * (1 + 0.3 * poses[None, :])
    return 1 / np.abs(natural**2 - lines[:, None] ** 2 + 2j * 0.1 * natural * lines[:, None])


def measured(lines, poses):
    return (
        3 * simulated(lines, poses) * np.exp(0.3 * np.sin(3 * poses[None, :] + lines[:, None] / 9))
    )


@pytest.mark.parametrize(
    ("model", "logarithm"),
    [
        ("GP", False),
        ("NARGP", False),
        pytest.param("MFDGP", False, marks=pytest.mark.slow),
        ("GP", True),
    ],
)
def test_between_measured_poses_the_surface_is_met(model, logarithm):
    seen, wanted = POSES[::2], POSES[1::2]
    fine = np.linspace(0, 1, 9)
    low = Grid(LINES, fine, simulated(LINES, fine))
    fitted = fit_surface(
        Grid(LINES, seen, measured(LINES, seen)), low, model, QUICK, logarithm=logarithm
    )
    told, sd = fitted.predict(LINES, wanted)
    true = measured(LINES, wanted)
    assert told.shape == sd.shape == (20, 4)
    assert (sd > 0).all()
    assert not logarithm or (told > 0).all()
    off = np.sqrt(np.mean((told - true) ** 2)) / np.std(true)
    assert off < (0.5 if model == "NARGP" else 0.9)  # five poses alone say less than simulation


def test_what_cannot_be_fitted_is_said_in_words():
    good = Grid(LINES, POSES, simulated(LINES, POSES))
    with pytest.raises(InputError, match="NARGP"):
        fit_surface(good, good, "kriging")
    holed = Grid(LINES, POSES, good.amplitude * np.where(np.arange(9) == 3, 0.0, 1.0))
    with pytest.raises(InputError, match="leave its line out"):
        fit_surface(holed, good, "GP")


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
    scaled = (y.reshape(-1) - fitted.units.centre) / fitted.units.scale
    mean, sd = fitted.predict(query)
    np.testing.assert_allclose(
        (mean - fitted.units.centre) / fitted.units.scale,
        cross.T @ np.linalg.solve(k, scaled),
        atol=1e-5,
    )
    variance = np.diag(cov(query, query) - cross.T @ np.linalg.solve(k, cross))
    np.testing.assert_allclose((sd / fitted.units.scale) ** 2, variance, atol=1e-5)
    dense = -0.5 * (scaled @ np.linalg.solve(k, scaled) + np.linalg.slogdet(2 * np.pi * k)[1])
    assert fitted.solved.value == pytest.approx(dense, rel=1e-4)


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


RANKS = pytest.mark.parametrize("rank", [None, 2])


def smooth(x):
    return np.column_stack([np.sin(4 * x[:, 0]), np.cos(3 * x[:, 1]) * x[:, 0]])


def related(n, m=5, noise=0.05):
    """m outputs that are sums of two smooth functions, in which proportions, with noise."""
    rng = np.random.default_rng(0)
    x = rng.random((n, 2))
    mixed = rng.standard_normal((2, m))
    return x, mixed, smooth(x) @ mixed + noise * rng.standard_normal((n, m))


def hyperparameters(m, rank, seed=1):
    rng = np.random.default_rng(seed)
    weights = rng.standard_normal((m, rank or m))
    own = rng.normal(-1, 0.3, m) if rank else np.full(m, -np.inf)
    noise, theta = rng.normal(-1, 0.3, m), np.array([0.0, -2.0, -0.5, -0.3])
    return Hyperparameters(weights if rank else np.tril(weights), own, noise, theta)


def dense(data, h):
    """B ⊗ K_x + D of outputs task by task."""
    k = parse("rbf", 2).covariance(np, h.theta, data.x, data.x)
    k = k + 1e-9 * np.mean(np.diag(k)) * np.eye(len(k))
    return np.kron(h.task_covariance, k) + np.kron(np.diag(h.noise), np.eye(len(k)))


@pytest.mark.parametrize(("count", "rank"), [(3, None), (4, 2), (144, 2)])
def test_kronecker_is_dense(count, rank):
    x, _, y = related(10, count)
    data, h = Tasks.of(x, y), hyperparameters(count, rank)
    solved, full, flat = solve(data, h), dense(data, h), data.y.T.ravel()
    value = multivariate_normal(np.zeros(len(flat)), full).logpdf(flat)
    np.testing.assert_allclose(solved.value, value, rtol=1e-8)
    alpha = np.linalg.solve(full, flat).reshape(count, 10).T
    np.testing.assert_allclose(solved.alpha, alpha, rtol=1e-6, atol=1e-7)


@RANKS
def test_slopes_agree_with_finite_differences(rank):
    x, _, y = related(9)
    data, h = Tasks.of(x, y), hyperparameters(5, rank)
    _, slope = log_density(data, h)
    rng, vector = np.random.default_rng(3), h.flat()
    for _ in range(4):
        way = np.where(np.isfinite(vector), rng.standard_normal(len(vector)), 0.0)
        way[-3] = 0.0  # the nugget's place in θ, which D holds
        ends = [log_density(data, h.like(vector + s * way))[0] for s in (1e-5, -1e-5)]
        np.testing.assert_allclose(slope @ way, (ends[0] - ends[1]) / 2e-5, rtol=1e-4)


@RANKS
def test_predictions_are_those_of_the_dense_gp(rank):
    x, _, y = related(10, 4)
    fitted, there = fit_multitask(x, y, rank=rank), np.random.default_rng(5).random((6, 2))
    h, data = fitted.hyperparameters, fitted.tasks
    wide = np.kron(h.task_covariance, parse("rbf", 2).covariance(np, h.theta, there, x))
    full = dense(data, h)
    mean = (wide @ np.linalg.solve(full, data.y.T.ravel())).reshape(4, 6).T
    own = np.repeat(np.diag(h.task_covariance), 6)
    variance = (own - np.einsum("ij,ji->i", wide, np.linalg.solve(full, wide.T))).reshape(4, 6).T
    told = fitted.predict(there)
    np.testing.assert_allclose(told[0], data.centre + data.scale * mean, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(told[1] ** 2, data.scale**2 * variance, rtol=1e-3, atol=1e-6)


def test_related_outputs_are_followed_and_many_tell_more_than_each_alone():
    x, mixed, y = related(25)
    assert np.sqrt(np.mean((fit_multitask(x, y).predict(x)[0] - smooth(x) @ mixed) ** 2)) < 0.05
    x, mixed, y = related(20, 40, noise=0.4)
    there = np.random.default_rng(6).random((50, 2))
    true = smooth(there) @ mixed
    together = fit_multitask(x, y, rank=RANK).predict(there)[0][:, :8]
    alone = np.column_stack([fit_multitask(x, y[:, [i]]).predict(there)[0] for i in range(8)])
    off = [np.sqrt(np.mean((mean - true[:, :8]) ** 2)) for mean in (together, alone)]
    assert off[0] < 0.8 * off[1]


@RANKS
def test_degenerate_data_work_and_missing_values_are_no_input(rank):
    x, _, y = related(3)
    y[:, 1] = 4.0
    for mean_and_sd in (fit_multitask(x[:n], y[:n], rank=rank).predict(x) for n in (1, 3)):
        assert np.isfinite(mean_and_sd).all()
    with pytest.raises(InputError, match="Output 3"):
        fit_multitask(x, np.where(np.arange(5) == 2, np.nan, y), rank=rank)
