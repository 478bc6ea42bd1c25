"""Inertias that a body can have, and the barrier before those that none can."""

import numpy as np
import pytest

from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Priors
from planner.effects.table import EffectLibrary
from planner.fit.inertias import BodyNumbers, pseudo_inertia
from planner.fit.structure import RobotPrior, RobotStructure
from planner.proof.arms import KR10
from planner.robot.robot import Robot


@pytest.fixture(scope="module")
def bodies(tmp_path_factory) -> BodyNumbers:
    simulation = Simulation(Robot.load(KR10.write(tmp_path_factory.mktemp("robot"))))
    library = EffectLibrary.of(simulation, Priors(mass=0.05, inertia=0.05, com_m=0.01))
    return RobotStructure(RobotPrior(library)).bodies


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


def test_nothing_is_lost_at_the_nominal_bodies(bodies):
    value, gradient, _ = bodies.barrier(np.zeros(bodies.size))
    assert value == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(gradient, 0.0, atol=1e-12)


def test_the_slope_is_that_of_differences(bodies):
    phi = 0.2 * np.random.default_rng(1).normal(size=bodies.size)
    _, gradient, _ = bodies.barrier(phi)
    for i in range(bodies.size):
        step = 1e-6 * np.eye(bodies.size)[i]
        up, down = bodies.barrier(phi + step)[0], bodies.barrier(phi - step)[0]
        assert gradient[i] == pytest.approx((up - down) / 2e-6, rel=1e-4, abs=1e-6)


def test_what_no_matter_can_form_is_infinitely_far(bodies):
    direction = np.random.default_rng(2).normal(size=bodies.size)
    values = [bodies.barrier(t * direction)[0] for t in (0.1, 0.2, 0.3, 1000.0)]
    assert values[0] < values[1] < values[2] < values[3] == np.inf
