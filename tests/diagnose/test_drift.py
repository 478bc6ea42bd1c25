"""Drift that is none: a fit that found a better minimum is no change in time."""

from dataclasses import replace

import numpy as np
import pytest

from planner.diagnosis.drift_or_pose import doubtful
from planner.diagnosis.finding import Finding
from planner.diagnosis.linear.drift_fit import problem_of
from planner.diagnosis.screens import drift
from planner.diagnosis.screens.drift import screen
from planner.dynamics.simulation import Simulation
from planner.robot.robot import Robot
from tests.support.known_robots import KR210
from tests.support.synthetic_hits import recorded


@pytest.fixture(scope="module")
def simulation(tmp_path_factory):
    return Simulation(Robot.load(KR210.write(tmp_path_factory.mktemp("robot"))))


def stuck(recorded_, nominal):
    """The true fits, but that the one without drift has a joint twice as stiff."""
    plain, *found = TRUE_FITS(recorded_, nominal)
    x = plain.x + np.log(2.0) * (np.arange(len(plain.x)) == 1)
    return replace(plain, x=x, data=plain.misfit.by_pose(x)), *found


TRUE_FITS = drift.fits


def test_no_drift_where_only_the_fit_without_it_went_wrong(simulation, monkeypatch):
    still = recorded(simulation, KR210.poses(4, 3))
    assert screen(still, simulation) == ()
    monkeypatch.setattr(drift, "fits", stuck)
    plain, *_ = stuck(still, simulation)
    assert plain.per_value > 3 * min(f.per_value for f in drift.fits(still, simulation))
    assert screen(still, simulation) == ()
    monkeypatch.setattr(drift, "DRIFT_MOVED", 0.0)  # a change that is sure, and next to none
    assert screen(still, simulation) == ()


def test_drift_that_is_there_is_found(simulation):
    def softer(visit: int, level: int) -> float:
        return 1.0 - 0.05 * visit

    moving = recorded(simulation, KR210.poses(4, 3), softer)
    (found,) = screen(moving, simulation)
    change, sd, _ = found.parameters["change"]
    assert change == pytest.approx(-0.15, abs=4 * sd)
    assert problem_of(moving, simulation).order[-1] == 1.0


def test_stiffness_that_goes_with_the_angle_is_no_drift_where_no_pose_was_returned_to(simulation):
    """Poses visited by rising angle of joint 3, whose stiffness follows it."""
    q = KR210.poses(5, 3)
    q = q[np.argsort(q[:, 2])]
    joint = np.arange(len(simulation.elasticity.stiffness)) == 2

    def with_angle(visit: int, level: int) -> np.ndarray:
        return 1.0 + 0.3 * np.cos(2 * q[visit, 2] + 1.0) * joint

    told = Finding("drift", "campaign", 500.0, {"change": (0.2, 0.01, "1")}, "", 1.5, gain=8.0)
    assert doubtful(told, recorded(simulation, q, with_angle, (300.0,)), simulation)


@pytest.mark.slow
def test_one_joint_that_drifts_is_no_stiffness_that_goes_with_the_angle(simulation):
    joint = np.arange(len(simulation.elasticity.stiffness)) == 2

    def with_time(visit: int, level: int) -> np.ndarray:
        return 1.0 - 0.08 * visit * joint

    moving = recorded(simulation, KR210.poses(5, 3), with_time, (300.0,))
    (found,) = screen(moving, simulation)
    assert not doubtful(found, moving, simulation)
