"""A robot whose robot.toml states bearings only: no joint has a spring about its own axis."""

import numpy as np
import pytest

from planner.diagnosis.screens import drift, force_levels
from planner.diagnosis.thresholds import UNKNOWN
from planner.dynamics.simulation import Simulation
from planner.robot.robot import Robot
from tests.support.known_robots import KR210
from tests.support.synthetic_hits import recorded


@pytest.fixture(scope="module")
def simulation(tmp_path_factory):
    path = KR210.write(tmp_path_factory.mktemp("bearings"))
    path.write_text(path.read_text().replace("axis = [0.0, 0.0, 1.0]", "axis = [1.0, 0.0, 0.0]"))
    return Simulation(Robot.load(path))


def test_levels_that_change_are_told_without_a_law_at_a_joint(simulation):
    def softer(visit: int, level: int) -> np.ndarray:
        return np.array([1, 1 - 0.2 * level, 1, 1, 1, 1.0])

    levels = recorded(simulation, KR210.poses(2, 3), softer, noise=0.002)
    (found,) = force_levels.screen(levels, simulation, single=True)
    assert found.effect == UNKNOWN
    assert "about its own axis" in found.text


def test_drift_is_followed_in_all_springs_together_alone(simulation):
    def softer(visit: int, level: int) -> float:
        return 1.0 - 0.05 * visit

    still, moving = (recorded(simulation, KR210.poses(4, 3), f) for f in (lambda v, n: 1.0, softer))
    assert drift.screen(still, simulation) == ()
    (found,) = drift.screen(moving, simulation)
    change, sd, _ = found.parameters["change"]
    assert change == pytest.approx(-0.15, abs=4 * sd)
