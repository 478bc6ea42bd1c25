"""Acquisition "stability": what it expects to be wrong, against refits and against trials."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from planner.design.acquisitions import _wrong, share_left, stability, with_margins
from planner.design.frequency_posterior import Margins
from planner.surrogate.modal_surrogate import fit_surrogate
from tests.support.scored_poses import X, over, with_parameters
from tests.support.surrogates import observed

PATH = np.array([100, 105, 110])


@pytest.fixture(scope="module")
def surrogate():
    return fit_surrogate(observed(6, 0))


def asked(surrogate, margin, sd=0.1, parameters=True):
    """Outputs with margins at three of the candidates, which hang on two labels."""
    outputs, poses = with_parameters(surrogate, X) if parameters else over(surrogate, X, 20)
    slope = np.tile([2.0, -1.0, 0.0, 0.0], (3, 1))
    there = Margins(poses[PATH], np.array(margin), np.full(3, sd), slope, np.zeros(3))
    return with_margins(outputs, there), poses


def test_what_is_foretold_of_a_pose_is_what_planning_it_leaves(surrogate):
    outputs, poses = asked(surrogate, [0.1, -0.1, 0.0])
    assert share_left(outputs) == pytest.approx(np.ones(3))
    foretold = share_left(outputs, poses)
    for i in (3, 50, 105):
        planned = share_left(outputs.planning(poses.one(i)))
        assert planned == pytest.approx(foretold[i], rel=1e-6)
        assert np.all(planned < 1)


def test_wrong_answers_are_those_of_trials(surrogate):
    """Draw what is measured, answer by the new mean, and count against what is true."""
    outputs, _ = asked(surrogate, [0.05, -0.12, 0.3])
    margins, left = outputs.margins, np.array([0.3, 0.6, 0.9])
    assert margins is not None
    rng = np.random.default_rng(1)
    mean = margins.margin + margins.sd * np.sqrt(1 - left) * rng.standard_normal((200_000, 3))
    true = mean + margins.sd * np.sqrt(left) * rng.standard_normal(mean.shape)
    wrong = np.mean((mean > 0) != (true > 0), axis=0)
    assert _wrong(margins, left) == pytest.approx(wrong, abs=0.01)  # by 15 nodes, over a kink
    nothing = _wrong(margins, np.ones(3))
    assert nothing == pytest.approx(norm.cdf(-np.abs(margins.margin) / margins.sd))


def test_it_measures_where_the_answer_is_open(surrogate):
    """Where poses tell little of each other: the one whose margin is about zero."""
    for pose in range(3):
        margin = np.where(np.arange(3) == pose, 0.01, 2.0)
        outputs, poses = asked(surrogate, margin, parameters=False)
        score = stability(outputs, poses[PATH])
        assert np.argmax(score) == pose
        assert np.all(score >= 0)


def test_more_measurements_do_not_make_more_mistakes(surrogate):
    outputs, poses = asked(surrogate, [0.05, -0.05, 0.1])
    first = stability(outputs, poses)
    after = stability(outputs.planning(poses.one(int(np.argmax(first)))), poses)
    assert np.all(first > -1e-9)
    assert after.max() < first.max()
    without = replace(outputs, margins=None)
    assert np.all(stability(without, poses) > 0)
