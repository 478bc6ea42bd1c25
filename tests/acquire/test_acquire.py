"""Acquisitions: exact against a refit, deterministic, never the same place twice."""

import numpy as np
import pytest

from planner.design.frequency_posterior import FrequencyOutputs, Poses, Target
from planner.design.integrated_variance import integrated_variance
from planner.design.propose import ACQUISITIONS, propose
from planner.design.space_filling import DESIGNS
from planner.errors import InputError
from planner.surrogate.modal_surrogate import fit_surrogate
from test_fusion import observed, simulated

X = np.random.default_rng(4).random((120, 2))
NAMES = [*ACQUISITIONS, *DESIGNS]


@pytest.fixture(scope="module")
def surrogate():
    return fit_surrogate(observed(5, 0))


def over(surrogate, x, workspace):
    """Outputs over the first poses of x (n, 2), and all of them as poses."""
    poses = Poses.plain(x, surrogate.frequency_inputs(simulated(x)))
    return FrequencyOutputs.of(surrogate, Target.evenly(poses[:workspace])), poses


def with_parameters(surrogate, x, p=6, seed=1):
    """The same with p open parameters of a made-up simulation."""
    rng = np.random.default_rng(seed)
    plain = Poses.plain(x, surrogate.frequency_inputs(simulated(x)))
    slope = 0.3 * np.sin(x @ rng.normal(size=(2, 4 * p)) * 3).reshape(len(x), 4, p)
    j = rng.normal(size=(len(x), 3, 2, p)) * (1 + x[:, :1, None, None])
    information = np.swapaxes(j, 2, 3) @ j
    poses = Poses(plain.x, plain.low, slope, information)
    covariance = np.cov(rng.normal(size=(p, 3 * p))) * 0.01
    return FrequencyOutputs.of(surrogate, Target.evenly(poses[:20]), None, covariance), poses


def conditioned_variance(outputs, k, c, low_c):
    """Mean variance over the workspace once c is measured, by adding a row to the GP itself."""
    post, total = outputs.posterior, []
    known = np.flatnonzero(post.mask[k])
    x = np.vstack([post.x[known], c[None]])
    low = np.append(post.low[k][known], low_c)
    for s in range(len(post.theta[k])):
        whiten = post.whiten[k][s][np.ix_(known, known)]
        noisy = np.linalg.inv(whiten.T @ whiten)  # covariance of what was measured, with noise
        cross = post._prior(k, post.x[known], low[:-1], c[None], low[-1:])[s]
        own = post._prior(k, c[None], low[-1:], c[None], low[-1:])[s] + outputs.noise[k]
        grown = np.block([[noisy, cross], [cross.T, own]])
        xu, lu = outputs.workspace.poses.x, outputs.workspace.poses.low[:, k]
        at = post._prior(k, x, low, xu, lu)[s]
        there = post._prior(k, xu, lu, xu, lu)[s]
        reduced = np.sum(at * np.linalg.solve(grown, at), axis=0)
        total.append(np.mean(np.diag(there) - reduced))
    return float(np.mean(total))


def test_integrated_variance_is_that_of_an_actual_refit(surrogate):
    outputs, poses = over(surrogate, X, 30)
    low = poses.low
    score = integrated_variance(outputs, poses[:4])
    for i in range(4):
        drop = 0.0
        for k in range(4):
            _, _, before = outputs.covariance(k, poses[:1], outputs.workspace.poses)
            after = conditioned_variance(outputs, k, X[i], low[i, k])
            drop += outputs.weights[k] * (np.mean(before) - after)
        assert score[i] == pytest.approx(drop, rel=1e-6)


def test_planned_poses_count_as_if_measured(surrogate):
    outputs, poses = over(surrogate, X, 30)
    outputs, low = outputs.planning(poses.one(40)), poses.low
    _, _, variance = outputs.covariance(1, poses[:1], outputs.workspace.poses)
    assert np.mean(variance) == pytest.approx(
        conditioned_variance(outputs, 1, X[40], low[40, 1]), rel=1e-6
    )


@pytest.mark.parametrize("name", ACQUISITIONS)
def test_a_score_belongs_to_its_candidate_alone(surrogate, name):
    """More candidates than are taken at a time, in another order: the same score for each."""
    outputs, poses = with_parameters(surrogate, np.random.default_rng(8).random((300, 2)))
    order = np.random.default_rng(9).permutation(300)
    score = ACQUISITIONS[name](outputs, poses)
    again = ACQUISITIONS[name](outputs, poses[order])
    np.testing.assert_allclose(again, score[order], rtol=1e-9)
    assert (score > 0).all()
    assert ACQUISITIONS[name](outputs, poses[:0]).shape == (0,)


def test_variance_is_what_prediction_says_but_for_doubt_about_hyperparameters(surrogate):
    outputs, poses = over(surrogate, X, 30)
    _, sd = surrogate.primary.predict(X, np.log(simulated(X).frequency_hz))
    total = np.mean(sd**2, axis=1)
    score = ACQUISITIONS["variance"](outputs, poses)
    assert (score <= total * (1 + 1e-9)).all()
    assert np.corrcoef(score, total)[0, 1] > 0.9


def test_a_planned_pose_is_known_to_within_its_noise(surrogate):
    outputs, poses = over(surrogate, X, 30)
    outputs = outputs.planning(poses.one(40))
    for k in range(4):
        assert outputs.variance(k, poses.one(40))[0] <= outputs.noise[k]


@pytest.mark.parametrize("name", NAMES)
def test_every_strategy_returns_distinct_reachable_poses(surrogate, name):
    taken = X[:20]
    first = propose(name, surrogate, X, simulated(X), 5, taken, seed=3)
    again = propose(name, surrogate, X, simulated(X), 5, taken, seed=3)
    assert [p.index for p in first] == [p.index for p in again]
    assert len({p.index for p in first}) == 5
    assert all(p.index >= 20 for p in first)


@pytest.mark.parametrize("name", NAMES)
def test_when_nothing_is_left_nothing_is_proposed(surrogate, name):
    assert propose(name, surrogate, X[:3], simulated(X[:3]), 1, X[:3], seed=0) == ()


def test_unknown_names_are_refused(surrogate):
    with pytest.raises(InputError, match="integrated_variance"):
        propose("crystal_ball", surrogate, X, simulated(X), 1, None, seed=0)
