"""Inertias that a body can have, and the barrier before those that none can."""

import numpy as np
import pytest

from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Priors, parametrise
from planner.fit.inertias import pseudo_inertia
from planner.identification.feasible_inertias import Barrier
from planner.robot.robot import Robot
from tests.support.known_robots import kr10_folder


@pytest.fixture(scope="module")
def barrier(tmp_path_factory) -> Barrier:
    simulation = Simulation(Robot.load(kr10_folder(tmp_path_factory.mktemp("robot"))))
    p = parametrise(simulation, Priors(mass=0.05, inertia=0.05, com_m=0.01))
    found = Barrier.around(simulation.elastic.inertia, p)
    assert found is not None
    return found


def test_pseudo_inertia_of_points_is_their_sum_of_squares():
    rng = np.random.default_rng(0)
    points, mass = rng.normal(size=(5, 3)), rng.uniform(0.5, 2.0, 5)
    moments = sum(
        m * (c @ c * np.eye(3) - np.outer(c, c)) for m, c in zip(mass, points, strict=True)
    )
    xx, xy, yy, xz, yz, zz = (moments[i, j] for i, j in
                              ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)))  # fmt: skip
    inertia = np.array([mass.sum(), *(mass @ points), xx, xy, yy, xz, yz, zz])
    one = np.column_stack([points, np.ones(5)])
    np.testing.assert_allclose(pseudo_inertia(inertia), one.T @ (mass[:, None] * one))


def test_nothing_is_lost_at_the_nominal_bodies(barrier):
    size = barrier.slope.shape[0] * barrier.slope.shape[1]
    value, gradient, _ = barrier(np.zeros(size))
    assert value == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(gradient, 0.0, atol=1e-12)


def test_derivatives_are_those_of_differences(barrier):
    size = barrier.slope.shape[0] * barrier.slope.shape[1]
    phi = 0.2 * np.random.default_rng(1).normal(size=size)
    _, gradient, hessian = barrier(phi)
    for i in range(size):
        step = 1e-6 * np.eye(size)[i]
        up, down = barrier(phi + step), barrier(phi - step)
        assert gradient[i] == pytest.approx((up[0] - down[0]) / 2e-6, rel=1e-5, abs=1e-7)
        np.testing.assert_allclose(hessian[i], (up[1] - down[1]) / 2e-6, rtol=1e-4, atol=1e-6)


def test_what_no_matter_can_form_is_infinitely_far(barrier):
    size = barrier.slope.shape[0] * barrier.slope.shape[1]
    direction = np.random.default_rng(2).normal(size=size)
    values = [barrier(t * direction)[0] for t in (0.1, 0.2, 0.3, 1000.0)]
    assert values[0] < values[1] < values[2] < values[3] == np.inf
