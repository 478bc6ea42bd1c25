"""Identification of a robot so soft that gravity is stronger than some of the springs tried."""

import numpy as np
import pytest

from measured_frfs import measured_frfs
from plain_arm import make_plain_arm
from planner.errors import InputError
from planner.identify.identify import identify
from planner.identify.objective import stands
from planner.identify.parameters import Priors, parametrise
from planner.physics.simulation import Simulation
from planner.robot.robot import Robot
from planner.truth.deviation import Deviation
from planner.truth.model import load_truth

# Stretched upwards, where gravity softens most.
Q = np.deg2rad([(0, -85, 5, 0), (30, -70, -10, 40), (-20, -80, 30, -60)])
LINES = np.linspace(1.0, 30.0, 60)
SOFTER = 150.0  # of the plain arm: carries its weight with little to spare


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return make_plain_arm(tmp_path_factory.mktemp("soft"), softer=SOFTER)


@pytest.fixture(scope="module")
def frfs(arm):
    return measured_frfs(load_truth(arm, Deviation(seed=2, stiffness=0.1)), Q, LINES, 0.02)


def test_random_starts_that_buckle_are_made_to_stand(arm, frfs):
    simulation = Simulation(Robot.load(arm))
    p = parametrise(simulation, Priors())
    matrices = simulation.elastic.matrices(Q)
    soft = p.mean - np.log(8) * np.array([x.kind == "stiffness" for x in p.parameters])
    starts = np.exp([p.mean, soft, soft + 0.3, soft - 0.3])
    assert [stands(matrices, p.elasticity(np.log(s)).stiffness) for s in starts] == [1, 0, 0, 0]
    found = identify(frfs, Q, simulation, band_hz=(1.0, 30.0), starts=starts)
    alone = identify(frfs, Q, simulation, band_hz=(1.0, 30.0), starts=starts[1:2])
    drawn = identify(frfs, Q, simulation, band_hz=(1.0, 30.0), starts=6, seed=3)
    for each in (found, alone, drawn):
        assert each.fit.frac > 0.99
        assert stands(matrices, each.simulation.elasticity.stiffness)


def test_springs_that_could_never_carry_the_robot_are_said(tmp_path, frfs):
    simulation = Simulation(Robot.load(make_plain_arm(tmp_path, softer=1e7)))
    with pytest.raises(InputError, match="far too soft to carry the robot's weight"):
        identify(frfs, Q, simulation, band_hz=(1.0, 30.0), starts=1)
