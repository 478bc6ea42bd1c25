"""Which poses are held out, and that they are judged by a fit that has not seen them."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Priors
from planner.errors import InputError
from planner.fit.held_out import identify_judged, set_aside
from planner.measurement.agreement import fit_similarity
from planner.proof.arms import KR10
from planner.proof.deviation import Deviation
from planner.proof.load import load_truth
from planner.robot.robot import Robot
from tests.support.measured_frfs import measured_frfs


@given(st.integers(1, 30), st.integers(0, 5))
def test_about_one_pose_of_four_is_set_aside(n, seed):
    q = np.random.default_rng(seed).uniform(-1, 1, (n, 6))
    aside = set_aside(q)
    assert len(set(aside)) == len(aside)
    assert len(aside) == (0 if n < 3 else max(1, n // 4))
    assert set(aside) <= set(range(n))


@given(st.integers(2, 20), st.data())
def test_as_many_as_are_asked_for(n, data):
    q = np.random.default_rng(n).uniform(-1, 1, (n, 6))
    count = data.draw(st.integers(0, n - 1))
    assert len(set(set_aside(q, count))) == count
    with pytest.raises(InputError, match="leaves none"):
        set_aside(q, n)


def test_set_aside_does_not_depend_on_units_of_a_joint_or_repeated_angles():
    q = np.random.default_rng(1).uniform(-1, 1, (12, 6))
    q[:, 3] = 0.7  # a joint that never moved
    assert set_aside(q) == set_aside(q * [1, 5, 1, 1, 0.1, 1])
    assert len(set_aside(np.zeros((8, 6)))) == 2


def test_held_out_poses_are_not_fitted(tmp_path: Path):
    """Spoiling the FRFs there spoils the verdict, not the identification that is judged."""
    path, lines = KR10.write(tmp_path), np.linspace(5.0, 60.0, 60)
    simulation, q = Simulation(Robot.load(path)), KR10.poses(5, seed=2)
    truth = load_truth(path, Deviation(seed=3, stiffness=0.3))
    frfs = list(measured_frfs(truth, q, lines, 0.02))
    options = {"band_hz": (5.0, 60.0), "extend": False}
    judged = identify_judged(frfs, q, simulation, Priors(), **options)
    (aside,) = judged.held_out
    there = fit_similarity(
        judged.trial.identified.simulation, [frfs[aside]], q[[aside]], (5.0, 60.0)
    )
    assert there == judged.held_out_after
    assert judged.held_out_after.frac > 0.99 > judged.held_out_before.frac
    spoilt = dataclasses.replace(frfs[aside], accelerance=frfs[aside].accelerance[..., ::-1])
    frfs[aside] = spoilt
    other = identify_judged(frfs, q, simulation, Priors(), **options)
    np.testing.assert_array_equal(other.trial.posterior.x, judged.trial.posterior.x)
    assert other.held_out_after.frac < 0.9
