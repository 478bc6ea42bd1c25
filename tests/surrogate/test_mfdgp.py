"""MFDGP as published: its bound, computed another way; its predictions; both layers trained."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from planner import jax_setup
from planner.surrogate.kernels import parse
from planner.surrogate.models.likelihood_gp import Samples
from planner.surrogate.models.mfdgp import TiedKernel, Training, fit_mfdgp
from planner.surrogate.models.mfdgp import bound as bound_of_a_batch

# Data and inducing points of one size throughout, so that it is compiled once.
HOW = Training(held_steps=400, free_steps=600, inducing=8)
CHEAP = np.linspace(0, 1, 20)[:, None]


def wave(x):
    return np.sin(6 * x[:, 0])


def bent(x):
    return wave(x) ** 2 + 0.5 * x[:, 0]


@jax_setup.compiled(static_argnums=3)
def bound(layers, data, seed, draws):
    """With all points and so many draws of f_1 at each expensive one."""
    noise = jax.random.normal(jax.random.key(seed), (draws, len(data.y_high)))
    every = jnp.arange(len(data.y_low)), jnp.arange(len(data.y_high))
    return bound_of_a_batch(layers, data, *every, noise)


@pytest.fixture(scope="module")
def trained():
    x = np.linspace(0, 1, 9)[:, None]
    return fit_mfdgp(Samples.of(CHEAP, wave(CHEAP)), Samples.of(x, bent(x)), HOW)


def moments(kernel, layer, z, x):
    """Mean and covariance of f(x), from N(u | m, S) in u's own coordinates."""
    theta, m, root = layer
    k = kernel.covariance(np, theta, z, z)
    k = k + 1e-6 * np.mean(np.diag(k)) * np.eye(len(z))
    lower = np.linalg.cholesky(k)
    u, spread = lower @ m, lower @ np.tril(root)
    cross = kernel.covariance(np, theta, x, z) @ np.linalg.inv(k)
    own = kernel.covariance(np, theta, x, x)
    return cross @ u, own + cross @ (spread @ spread.T - k) @ cross.T, u, spread @ spread.T, k


def divergence(u, s, k):
    """KL of two normal distributions, as textbooks have it."""
    inverse = np.linalg.inv(k)
    logs = np.linalg.slogdet(k)[1] - np.linalg.slogdet(s)[1]
    return 0.5 * (np.trace(inverse @ s) + u @ inverse @ u - len(u) + logs)


def expected(theta, y, mean, variance):
    noise = np.exp(2 * theta[1])
    return -0.5 * np.log(2 * np.pi * noise) - ((y - mean) ** 2 + variance) / (2 * noise)


def spread_over(mean, covariance):
    """Values of f and their weights (k, q), by brute force over nine sds to both sides."""
    z = np.linspace(-9, 9, 201)
    weight = np.exp(-0.5 * z**2) / np.exp(-0.5 * z**2).sum()
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-12))
    return mean + sd * z[:, None], weight


def second_moments(trained, x, f):
    """Mean and variance (k, q) of layer 2 at x (q, 1) and values f (k, q) of layer 1."""
    second, z = trained.layers[1], trained.data.z_high
    wide = np.column_stack([np.tile(x, (len(f), 1)), f.reshape(-1)])
    parts = [moments(TiedKernel.cutajar(1), second, z, part) for part in np.array_split(wide, 100)]
    mean = np.concatenate([p[0] for p in parts]).reshape(f.shape)
    return mean, np.concatenate([np.diag(p[1]) for p in parts]).reshape(f.shape), parts[0][2:]


def test_the_bound_is_what_its_definition_says(trained):
    """Each expensive point's expectation is over one number, f_1(x): summed up by brute force."""
    (first, second), data = trained.layers, trained.data
    mean, covariance, *posterior = moments(parse("rbf", 1), first, data.z_low, data.x_low)
    total = expected(first.theta, data.y_low, mean, np.diag(covariance)).sum()
    total -= divergence(*posterior)
    mean, covariance, *_ = moments(parse("rbf", 1), first, data.z_low, data.x_high)
    f, weight = spread_over(mean, covariance)
    mean, variance, posterior = second_moments(trained, data.x_high, f)
    total += (weight @ expected(second.theta, data.y_high, mean, variance)).sum()
    total -= divergence(*posterior)
    told = [float(bound(trained.layers, data, seed, 256)) for seed in range(12)]
    unsure = np.std(told) / np.sqrt(len(told))
    assert unsure < 0.05
    np.testing.assert_allclose(np.mean(told), total, atol=4 * unsure)


def test_a_prediction_is_integrated_over_the_first_layer(trained):
    at, data = np.linspace(0.05, 0.95, 7)[:, None], trained.data
    mean, covariance, *_ = moments(parse("rbf", 1), trained.layers[0], data.z_low, at)
    f, weight = spread_over(mean, covariance)
    means, variances, _ = second_moments(trained, at, f)
    units, (mean, sd) = trained.high_units, trained.predict(at)
    middle = weight @ means
    np.testing.assert_allclose(mean, units.centre + units.scale * middle, rtol=1e-4)
    total = units.scale * np.sqrt(weight @ (variances + (means - middle) ** 2))
    np.testing.assert_allclose(sd, total, rtol=1e-3)


def test_it_learns_both_levels_together(trained):
    grid = np.linspace(0, 1, 41)[:, None]
    mean, sd = trained.predict(grid)
    assert np.sqrt(np.mean((mean - bent(grid)) ** 2)) < 0.1 * np.std(bent(grid)) + 0.05
    low = moments(parse("rbf", 1), trained.layers[0], trained.data.z_low, grid)[0]
    low = np.mean(wave(CHEAP)) + np.std(wave(CHEAP)) * low
    assert np.sqrt(np.mean((low - wave(grid)) ** 2)) < 0.05
    assert np.mean(np.abs(mean - bent(grid)) < 1.96 * sd) > 0.8


def test_the_first_stage_holds_noise_and_spread():
    cheap, x = np.linspace(0, 1, 20)[:, None], np.linspace(0, 1, 9)[:, None]
    held = fit_mfdgp(
        Samples.of(cheap, wave(cheap)), Samples.of(x, bent(x)), replace(HOW, free_steps=0)
    )
    for layer in held.layers:
        np.testing.assert_allclose(np.exp(layer.theta[1]), 0.1)
        np.testing.assert_array_equal(layer.root, 0.1 * np.eye(len(layer.root)))
        assert np.all(layer.mean != 0)
