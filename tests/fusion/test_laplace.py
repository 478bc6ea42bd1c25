"""Laplace mixtures of sparse, deep and multi-task models: exact where the posterior is Gaussian."""

import numpy as np
import pytest

from planner.studies.models import laplace
from planner.studies.models.fidelity_levels import Exact, Samples
from planner.studies.models.mfdgp import fit_mfdgp
from planner.studies.models.mixture import Mixture
from planner.studies.models.multitask import fit_multitask
from planner.studies.models.sparse_gp import average_sparse, fit_sparse
from planner.studies.models.task_average import average_tasks

GRID = np.random.default_rng(8).random((50, 2))


def wave(x):
    return np.sin(5 * x[:, 0]) + np.cos(3 * x[:, 1])


def test_of_a_gaussian_posterior_the_draws_are_its_own():
    root = np.array([[2.0, 0.0], [0.7, 1.5]])
    bent, peak = root @ root.T, np.array([0.3, -1.0])
    points, volume = laplace.draws(lambda z: bent @ (z - peak), peak, 512)
    np.testing.assert_allclose(points.mean(axis=0), peak, atol=1e-9)
    np.testing.assert_allclose(np.cov(points.T), np.linalg.inv(bent), atol=0.02)
    assert volume == pytest.approx(-0.5 * np.linalg.slogdet(bent)[1], rel=1e-6)


def test_a_direction_that_the_data_leave_open_is_as_wide_as_the_prior():
    points, _ = laplace.draws(lambda z: np.array([1e-3, 4.0]) * z, np.zeros(2), 512)
    np.testing.assert_allclose(points.std(axis=0), [1.0, 0.5], rtol=0.05)


def samples(n, seed=0):
    rng = np.random.default_rng(seed)
    x = rng.random((n, 2))
    return Samples.of(x, wave(x) + 0.05 * rng.standard_normal(n), 0.05)


def test_averaged_sparse_gps_are_less_sure_at_few_points_and_the_same_at_many():
    ratio = {}
    for n in (8, 200):
        s = samples(n)
        one = fit_sparse(s, "rbf", 40)
        both = average_sparse(one, s)
        assert isinstance(both, Mixture)
        assert np.isfinite(both.log_evidence)
        ratio[n] = np.mean(both.predict(GRID)[1]) / np.mean(one.predict(GRID)[1])
    print(f"sd averaged / most probable: {ratio}")
    assert ratio[8] > 1.02
    assert ratio[200] == pytest.approx(1, abs=0.1)


def test_a_deep_gp_of_few_measurements_is_averaged():
    s = samples(6)
    model = fit_mfdgp(s, Exact(lambda x: np.sin(5 * x[:, 0])))
    assert isinstance(model.high, Mixture)
    mean, sd = model.predict(GRID)
    assert np.isfinite(mean).all()
    assert (sd > 0).all()


def test_averaged_tasks_cover_what_they_say():
    inside, alone = [], []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        x = rng.random((7, 2))
        truth = lambda p: np.stack([wave(p), 0.7 * wave(p) + p[:, 0]], axis=1)  # noqa: E731
        fitted = fit_multitask(x, truth(x) + 0.02 * rng.standard_normal((7, 2)))
        for model, found in ((average_tasks(fitted), inside), (fitted, alone)):
            mean, sd = model.predict(GRID)
            found.append(np.mean(np.abs(mean - truth(GRID)) < 1.96 * sd))
    print(f"95 % intervals hold {np.mean(inside):.2f}, of the most probable {np.mean(alone):.2f}")
    assert np.mean(inside) >= np.mean(alone)
    assert np.mean(inside) > 0.85
