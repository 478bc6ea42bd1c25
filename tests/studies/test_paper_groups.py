"""The groups of Lei et al. 2023 and the bounds of Birk et al. 2025, as their papers print them."""

import numpy as np
import pytest

from planner.demo import shipped
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import parametrise
from planner.robot.robot import Robot
from planner.studies.birk2025_bounds import paper_priors
from planner.studies.birk2025_design import Informative
from planner.studies.lei2023_groups import groups, predict


@pytest.mark.parametrize("reference", [0, 1, 2, 3])
def test_nine_modes_make_70_models_that_hold_each_parameter_once(reference):
    found = groups(np.arange(9), np.full(9, reference))
    assert len(found) == 70  # section 5.2 of the paper
    assert max(len(group) for group in found) == 3
    np.testing.assert_array_equal(np.sort(np.concatenate(found)), np.arange(144))


def test_the_frequencies_of_low_modes_and_of_high_ones_are_apart():
    found = [set(group.tolist()) for group in groups(np.arange(9), np.full(9, 3))]
    f = [16 * k for k in range(9)]
    assert [set(f[:3]), set(f[3:5]), set(f[5:7]), set(f[7:])] == [g for g in found if g & set(f)]
    assert {2, 4} in found  # real parts of L at 1X and 1aX
    assert {13, 15} in found  # imaginary parts of R at 1Y and 1aY


def test_others_that_are_known_at_a_tested_posture_tell_what_it_is():
    rng = np.random.default_rng(0)
    x = rng.random((40, 2))
    rough = rng.standard_normal(40)  # follows no pose: only the other task can tell it
    y = np.column_stack([rough, -2 * rough]) + 0.05 * rng.standard_normal((40, 2))
    train = np.arange(40) < 30
    nothing, others = predict(x, y, train, [np.array([0, 1])])
    off = [np.sqrt(np.mean((told - y[~train]) ** 2, axis=0)) for told in (nothing, others)]
    assert np.all(off[0] > 0.5 * y.std(axis=0))
    assert np.all(off[1] < 0.15 * y.std(axis=0))


@pytest.mark.parametrize(("name", "count"), [("robot_12p.toml", 12), ("robot_24p.toml", 24)])
def test_every_parameter_has_the_bounds_of_tables_1_and_2(name, count):
    simulation = Simulation(Robot.load(shipped("kr10_birk2025") / "robot" / name))
    priors = paper_priors(simulation)
    assert len(parametrise(simulation, priors).parameters) == len(priors.bounds) == count
    low, high = priors.bounds["stiffness of joint_5 about y"]
    np.testing.assert_allclose(np.deg2rad([low, high]), [30, 1000])
    if count == 24:
        low, high = priors.bounds["stiffness of joint_3 across"]
        np.testing.assert_allclose(np.deg2rad([low, high]), [1250, 40000])


def test_the_best_points_tell_most_and_one_direction_tells_less():
    """Two parameters, five points: each of two tells of one parameter, the others of nothing."""
    told = np.zeros((5, 3, 2, 2))
    told[1, 0, 0, 0], told[3, 1, 1, 1] = 100.0, 400.0
    informative = Informative(np.eye(2), told)
    np.testing.assert_array_equal(informative.best(2), [3, 1])
    assert informative.determined(np.array([1, 3])) == 2
    assert informative.determined(np.array([1, 3]), [0]) == 1
    assert informative.determined(np.array([0, 2])) == 0
