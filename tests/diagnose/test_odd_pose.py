"""A pose at which the robot did not stand as was said is named; nothing is where all fit."""

import numpy as np
import pytest

from planner.diagnosis.linear_diagnosis import diagnose
from planner.diagnosis.odd_pose import odd_pose
from planner.dynamics.simulation import Simulation
from planner.frf.frf import Frf
from planner.robot.robot import Robot
from tests.support.robots import make_arm

NAMES = ["P001", "P002", "P003", "P004"]
Q = np.deg2rad([[10, -60, 80, 10, 40, 0], [-30, -80, 100, -20, 60, 20], [40, -50, 60, 30, -40, 10],
                [0, -90, 70, -30, 20, -20]])  # fmt: skip


@pytest.fixture(scope="module")
def simulation(tmp_path_factory):
    return Simulation(Robot.load(make_arm(tmp_path_factory.mktemp("arm"))))


def recorded(simulation, q, rng):
    """FRFs at q (n, dof) with 1 % of noise."""
    band = simulation.robot.config.band_hz
    lines = np.linspace(*band, 60)
    nan = np.full((3, 3, 60), np.nan)
    for h in simulation.accelerance(q, lines):
        noise = rng.standard_normal((*h.shape, 2)) @ np.array([1.0, 1j]) / np.sqrt(2)
        sd = 0.01 * np.abs(h)
        yield Frf(lines, h + sd * noise, sd**2 + 1e-12, nan, (1, 1, 1), band)


@pytest.mark.parametrize("wrong", [None, 2])
def test_the_pose_that_is_not_where_it_was_said_is_named(simulation, wrong):
    stood = Q.copy()
    if wrong is not None:
        stood[wrong] += np.deg2rad([0, 15, -20, 0, 25, 0])
    frfs = list(recorded(simulation, stood, np.random.default_rng(1)))
    found = odd_pose(diagnose(frfs, Q, simulation, effects=()), NAMES)
    if wrong is None:
        assert found is None
        return
    assert found is not None
    assert found.pose == NAMES[wrong]
    assert found.misfit > 10 > 1 >= found.misfit_without


def test_two_wrong_poses_are_no_single_odd_one(simulation):
    stood = Q.copy()
    stood[1:3] += np.deg2rad([[0, 20, 0, 0, 25, 0], [0, -15, 20, 10, 0, 0]])
    frfs = list(recorded(simulation, stood, np.random.default_rng(1)))
    assert odd_pose(diagnose(frfs, Q, simulation, effects=()), NAMES) is None
