"""Where one more sensor, or a hit elsewhere, tells more of the simulation's parameters a minute."""

from dataclasses import replace

import numpy as np
import pytest

from planner.design.cost import Cost
from planner.design.frequency_posterior import FrequencyOutputs, Poses, Target
from planner.design.parameter_sensitivity import FrfNoise, UncertainParameters, better_places
from planner.design.stopping import forecast
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import CAD_INERTIAS
from planner.fit.identify import robot_prior
from planner.fit.posterior import RobotBelief
from planner.measurement.nuisances import Tolerances
from planner.recording.points import Layout
from planner.robot.robot import Robot
from planner.surrogate.modal_surrogate import fit_surrogate
from tests.support.arm_with_points import poses, write_arm
from tests.support.surrogates import observed

COST = Cost(np.full(4, 0.2))


@pytest.fixture(scope="module")
def open_(tmp_path_factory) -> UncertainParameters:
    """An arm whose sensor at the tool has one axis; joint 2 and 3 tilt, springs are guessed."""
    springs = "".join(
        f'[[compliance]]\njoint = "{joint}"\naxis = {axis}\nstiffness = 1e6\ndamping = 300.0\n'
        for joint in ("a2", "a3")
        for axis in ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    )
    toml = write_arm(tmp_path_factory.mktemp("arm"), springs)
    one_axis = toml.read_text().replace('name = "sensor"\n', 'name = "sensor"\naxes = ["x"]\n')
    toml.write_text(one_axis)
    simulation = Simulation(Robot.load(toml))
    robot = RobotBelief.stated(robot_prior(simulation, CAD_INERTIAS), Tolerances())
    return UncertainParameters(robot, FrfNoise(0.01, 0.02, 0.5), (4.0, 90.0))


@pytest.fixture(scope="module")
def outputs(open_) -> FrequencyOutputs:
    surrogate, q = fit_surrogate(observed(6, 0)), poses(12, 5)
    said, x = open_.simulation.modes(q, 4), np.random.default_rng(0).uniform(size=(12, 2))
    low = np.zeros((12, 4))
    target = Target.evenly(open_.poses(x, low, q, said, informed=True))
    return FrequencyOutputs.of(surrogate, target, covariance=open_.covariance)


def proposed(open_) -> tuple[str, Poses, np.ndarray]:
    q = poses(1, 9)
    said = open_.simulation.modes(q, 4)
    return "P002", open_.poses(np.zeros((1, 2)), np.zeros((1, 4)), q, said, False), q[0]


def test_a_sensor_more_tells_no_less(open_):
    q = poses(2, 3)
    fewer = open_.information(q, Layout(("tcp",), ("sensor",)))
    more = open_.information(q, Layout(("tcp",), ("sensor", "elbow")))
    assert np.allclose(fewer, open_.information(q))
    gained = np.linalg.eigvalsh(more - fewer)
    assert gained.min() > -1e-8 * gained.max()
    assert gained.max() > 0


def test_what_is_proposed_holds_what_it_promises(open_, outputs):
    name, at, q = proposed(open_)
    found = better_places(open_, outputs, (name, at, q), COST, 0.5, 1.0)
    assert found is not None
    assert found.sentence.startswith("At P002 ")
    # By hand: Σ' = (Σ⁻¹ + F)⁻¹, and its mean variance over the workspace.
    for sensors, point, stated in (
        (found.sensors, found.hit_point, found.sd_percent),
        (("sensor",), "", found.sd_percent_as_it_is),
    ):
        told = open_.information(q[None], Layout(("tcp",), sensors))[0].sum(axis=0)
        if point:
            told = told + open_.information(q[None], Layout((point,), sensors))[0].sum(axis=0)
        after = np.linalg.inv(np.linalg.inv(open_.covariance) + told)
        slope = outputs.workspace.poses.slope * outputs.trust[:, None]
        variance = np.einsum("ukp,pr,ukr->uk", slope, after, slope)
        left = 100 * np.sqrt(np.sum(outputs.workspace.importance * variance))
        assert stated == pytest.approx(left, rel=1e-3)
    left = np.array([found.sd_percent, found.sd_percent_as_it_is])
    minutes = np.array([found.minutes, found.minutes_as_it_is])
    rate = np.log(found.sd_percent_now / left) / minutes
    assert rate[0] > rate[1]
    more = COST.per_sensor * bool(found.added) + COST.hitting((0, 1, 2)) * bool(found.hit_point)
    assert minutes[0] - minutes[1] == pytest.approx(more)


def test_no_sensor_is_asked_for_where_all_are_there(open_, outputs):
    every = ("sensor", "foot", "shoulder", "elbow")
    there = replace(open_, noise=replace(open_.noise, sensors=every))
    found = better_places(there, outputs, proposed(open_), COST, 0.5, 1.0)
    assert found is None or not found.added


def test_nothing_is_asked_for_once_the_tool_reaches_the_target(open_, outputs):
    assert better_places(open_, outputs, proposed(open_), COST, 0.5, 10.0) is None


def test_a_forecast_counts_what_parameters_gain(open_, outputs):
    best = outputs.workspace.poses.one(0)
    told = forecast(outputs, best, 1.0, 0.95)
    blind = forecast(outputs, best.uninformed, 1.0, 0.95)
    assert told.gain_percent > 2 * blind.gain_percent
