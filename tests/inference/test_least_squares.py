"""The damped least-squares solver, a step at a time and as a loop."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from planner.inference.least_squares import (
    Damping,
    Limits,
    Quadratic,
    accept,
    begin,
    expected,
    minimise,
    propose,
)

FACTORS = Damping(first=1e-3, least=0.0, most=1e8, lighter=0.1, heavier=10.0)


def rosenbrock(x: np.ndarray) -> Quadratic:
    residual = np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])
    jacobian = np.array([[-20 * x[0], 10.0], [-1.0, 0.0]])
    chi2 = float(residual @ residual)
    return Quadratic(chi2 / 2, jacobian.T @ residual, jacobian.T @ jacobian, chi2)


@pytest.mark.parametrize("rule", [Damping(), FACTORS])
def test_a_bent_valley_is_followed_to_its_end(rule):
    found = minimise(rosenbrock, np.array([-1.2, 1.0]), 1e-12, 200, rule=rule)
    np.testing.assert_allclose(found.x, [1.0, 1.0], atol=1e-6)


def test_fits_side_by_side_end_where_each_ends_alone():
    starts = [np.array([-1.2, 1.0]), np.array([2.0, -1.0]), np.array([0.0, 3.0])]
    fits = [begin(x, rosenbrock(x)) for x in starts]
    for _ in range(15):
        proposed = [propose(fit) for fit in fits]
        fits = [accept(f, x, rosenbrock(x)) for f, x in zip(fits, proposed, strict=True)]
    for fit, start in zip(fits, starts, strict=True):
        alone = minimise(rosenbrock, start, -np.inf, 15)
        np.testing.assert_array_equal(fit.x, alone.x)


def test_the_model_of_a_quadratic_expects_what_a_step_gains():
    rng = np.random.default_rng(0)
    root = rng.standard_normal((3, 3))
    normal, middle = root @ root.T + np.eye(3), rng.standard_normal(3)

    def bowl(x: np.ndarray) -> Quadratic:
        off = x - middle
        return Quadratic(float(off @ normal @ off) / 2, normal @ off, normal, 0.0)

    fit = begin(np.zeros(3), bowl(np.zeros(3)))
    x = propose(fit)
    after = accept(fit, x, bowl(x))
    assert after.gained == pytest.approx(expected(fit, x))
    assert after.damping < fit.damping


@pytest.mark.parametrize("impossible", [None, Quadratic(np.inf, np.zeros(1), np.eye(1), np.inf)])
def test_points_that_cannot_be_shorten_the_step(impossible):
    """√x − 2 towards x = 4 from 0.1, with nothing beyond 4.5: the first steps lead there."""

    def objective(x: np.ndarray) -> Quadratic | None:
        if not 0 < x[0] < 4.5:
            return impossible
        residual, slope = np.sqrt(x[0]) - 2.02, 0.5 / np.sqrt(x[0])
        return Quadratic(residual**2 / 2, slope * np.array([residual]), slope**2 * np.eye(1), 0.0)

    found = minimise(objective, np.array([0.1]), 1e-14, 200, longest=10.0)
    assert found.x[0] == pytest.approx(2.02**2, rel=1e-5)


def test_a_fit_whose_every_step_fails_is_stuck():
    fit = begin(np.array([-1.2, 1.0]), rosenbrock(np.array([-1.2, 1.0])), FACTORS)
    for _ in range(20):
        fit = accept(fit, propose(fit), None)
    assert fit.stuck
    np.testing.assert_array_equal(fit.x, [-1.2, 1.0])


def test_limits_of_a_step_and_the_box():
    x, step = np.zeros(2), np.array([3.0, 0.3])
    np.testing.assert_allclose(Limits(longest=1.5).within(x, step), [1.5, 0.15])
    each = Limits(longest=1.5, entrywise=True)
    np.testing.assert_allclose(each.within(x, step), [1.5, 0.3])
    box = Limits(longest=np.inf, lower=np.array([-1.0, 0.1]), upper=np.array([1.0, 0.2]))
    np.testing.assert_allclose(box.within(x, step), [1.0, 0.2])


@pytest.mark.parametrize("seed", range(5))
def test_what_reaches_a_side_of_the_box_does_not_hold_up_the_others(seed):
    """Against a peer that knows bounds, where parameters are nearly alike."""
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((12, 6)) @ (np.ones((6, 6)) + 0.05 * rng.standard_normal((6, 6)))
    b = a @ (3.0 * rng.standard_normal(6)) + rng.standard_normal(12)

    def objective(x: np.ndarray) -> Quadratic:
        r = a @ x - b
        return Quadratic(float(r @ r) / 2, a.T @ r, a.T @ a, float(r @ r))

    box = np.full(6, -1.0), np.full(6, 1.0)
    found = minimise(objective, np.zeros(6), 1e-12, 200, box=box)
    peer = lsq_linear(a, b, (-1.0, 1.0), tol=1e-14)
    assert np.all(np.abs(found.x) <= 1.0)
    assert found.at.value <= peer.cost * (1 + 1e-3)


def test_a_direction_without_curvature_stays():
    at = Quadratic(1.0, np.array([1.0, 0.0]), np.diag([1.0, 0.0]), 2.0)
    x = propose(begin(np.zeros(2), at))
    assert x[0] < -0.9
    assert x[1] == 0.0
