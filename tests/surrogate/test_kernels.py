"""Kernel expressions: laws, columns, sums and products; test_limits.py has their slopes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner import jax_setup
from planner.errors import InputError
from planner.surrogate.kernels import KERNELS, parse

SUMS = [
    "rbf+bias",
    "rbf[0:2]*quadratic[2:3]+linear",
    "matern52[:1]+cubic[1:]*bias",
    "quadratic*matern52+rbf[2:]",
]  # in which every kernel occurs


@pytest.fixture(autouse=True)
def _as_compiled():
    with jax_setup.numerics():
        yield


def random_theta(kernel, rng):
    return 0.3 * rng.standard_normal(kernel.size)


@pytest.mark.parametrize("expression", [*KERNELS, *SUMS])
@settings(deadline=None, max_examples=15)
@given(st.integers(0, 1000))
def test_expressions_are_positive_semidefinite_and_say_their_diagonal(expression, seed):
    rng = np.random.default_rng(seed)
    x, kernel = rng.standard_normal((12, 3)), parse(expression, 3)
    theta = random_theta(kernel, rng)
    k = kernel.covariance(np, theta, x, x)
    np.testing.assert_allclose(k, k.T, atol=1e-12)
    np.testing.assert_allclose(np.diag(k), kernel.variance(np, theta, x), rtol=1e-9)
    assert np.linalg.eigvalsh(k)[0] > -1e-8 * np.max(np.abs(k))


@pytest.mark.parametrize("expression", SUMS)
def test_many_hyperparameters_at_once_as_one_by_one_and_in_both_libraries(expression):
    rng = np.random.default_rng(0)
    kernel = parse(expression, 3)
    xa, xb = rng.standard_normal((5, 3)), rng.standard_normal((4, 3))
    thetas = np.array([random_theta(kernel, rng) for _ in range(3)])
    together = kernel.covariance(np, thetas, xa, xb)
    for theta, k in zip(thetas, together, strict=True):
        np.testing.assert_allclose(kernel.covariance(np, theta, xa, xb), k, atol=1e-13)
        other = jax.jit(lambda t, a, b: kernel.covariance(jnp, t, a, b))(theta, xa, xb)
        np.testing.assert_allclose(other, k, atol=1e-12)


def test_sums_and_products_are_sums_and_products():
    x = np.random.default_rng(1).standard_normal((6, 2))
    one = parse("rbf[:1]*linear[1:]+matern52", 2)
    theta = np.array([0.1, -3.0, 0.2, -0.1, 0.3, 0.4, -0.2])
    assert one.size == len(theta)
    product = KERNELS["rbf"](np, x[:, :1] / np.exp(0.2), x[:, :1] / np.exp(0.2)) * KERNELS[
        "linear"
    ](np, x[:, 1:] / np.exp(-0.1), x[:, 1:] / np.exp(-0.1))
    scaled = x / np.exp([0.4, -0.2])
    expected = np.exp(0.2) * product + np.exp(0.6) * KERNELS["matern52"](np, scaled, scaled)
    np.testing.assert_allclose(one.covariance(np, theta, x, x), expected, atol=1e-13)


@pytest.mark.parametrize("wrong", ["gauss", "rbf++bias", "rbf[", "rbf[0]", ""])
def test_what_is_no_kernel_is_said_in_words(wrong):
    with pytest.raises(InputError, match="sums and products"):
        parse(wrong, 2)


@pytest.mark.parametrize("shape", ["rbf", "matern52"])
@pytest.mark.parametrize("d", [2, 6])
def test_a_compiled_kernel_is_one_on_its_diagonal(shape, d):
    """XLA may compute r² twice and differently; the diagonal was 0.52 once."""
    x = np.random.default_rng(4).random((64, d))
    kernel = parse(shape, d)
    mean, _ = kernel.prior(1.0, 1e-3, 0.8, 1.0, 0.8)

    @jax.jit
    def compiled(z, x, low):
        k = kernel.covariance(jnp, mean + z, x, x)
        return k * low[:, None] * low[None, :] + jnp.diag(jnp.exp(low))

    k = compiled(np.zeros(kernel.size), x, np.ones(64))
    np.testing.assert_allclose(np.diag(k), 1 + np.e, rtol=1e-12)
