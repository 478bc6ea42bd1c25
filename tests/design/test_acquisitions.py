"""Every strategy: deterministic, never the same place twice; designs spread over a pool."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.design.acquisitions import integrated_variance
from planner.design.frequency_posterior import FrequencyOutputs, Target
from planner.design.propose import ACQUISITIONS
from planner.design.space_filling import DESIGNS, NESTED
from planner.errors import InputError
from planner.surrogate.modal_surrogate import fit_surrogate
from tests.support.surrogates import (
    X,
    conditioned_variance,
    observed,
    over,
    proposed,
    simulated,
    with_parameters,
)

NAMES = [*ACQUISITIONS, *DESIGNS]


@pytest.fixture(scope="module")
def surrogate():
    return fit_surrogate(observed(5, 0))


@pytest.mark.parametrize("weights", [None, (0.0, 0.0, 1.0, 0.0)])
def test_integrated_variance_is_that_of_an_actual_refit(surrogate, weights):
    _, poses = over(surrogate, X, 30)
    target = Target.evenly(poses[:30], *(() if weights is None else (np.array(weights),)))
    outputs = FrequencyOutputs.of(surrogate, target)
    score = integrated_variance(outputs, poses[:4])
    for i in range(4):
        drop = 0.0
        for k, weight in enumerate(outputs.weights):
            _, _, before = outputs.covariance(k, poses[:1], target.poses)
            after = conditioned_variance(outputs, k, X[i], poses.low[i, k])
            drop += weight * (np.mean(before) - after)
        assert score[i] == pytest.approx(drop, rel=1e-6)


def test_planned_poses_count_as_if_measured(surrogate):
    outputs, poses = over(surrogate, X, 30)
    outputs, low = outputs.planning(poses[[40]]), poses.low
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


@pytest.mark.parametrize("name", NAMES)
def test_every_strategy_returns_distinct_reachable_poses(surrogate, name):
    first, again = (proposed(name, surrogate, X, 5, 20) for _ in range(2))
    assert [p.index for p in first] == [p.index for p in again]
    assert len({p.index for p in first}) == 5
    assert all(p.index >= 20 for p in first)


@pytest.mark.parametrize("name", NAMES)
def test_when_nothing_is_left_nothing_is_proposed(surrogate, name):
    assert proposed(name, surrogate, X[:3], 1, 3) == ()


def test_unknown_names_are_refused(surrogate):
    with pytest.raises(InputError, match="integrated_variance"):
        proposed("crystal_ball", surrogate, X, 1)


@pytest.mark.parametrize("name", NESTED)
@settings(max_examples=15, deadline=None)
@given(st.integers(1, 40), st.integers(1, 4), st.integers(0, 50), st.data())
def test_a_design_holds_different_poses_and_is_its_seed_s(name, n, d, seed, data):
    x = np.random.default_rng(n).random((n, d))
    count = data.draw(st.integers(1, min(n, 8)))
    chosen = NESTED[name](x, count, seed)
    assert len(set(chosen.tolist())) == count
    assert np.all((chosen >= 0) & (chosen < n))
    assert np.array_equal(chosen, NESTED[name](x, count, seed))


@pytest.mark.parametrize("name", NESTED)
def test_seeds_give_different_designs(name):
    x = np.random.default_rng(0).random((60, 3))
    assert len({tuple(NESTED[name](x, 6, seed).tolist()) for seed in range(5)}) > 1


@pytest.mark.parametrize("prefix", [3, 5, 8])
def test_every_prefix_of_the_hypercube_is_spread_better_than_chance(prefix):
    x = np.random.default_rng(0).random((400, 2))

    def nearest_two(indices):
        points = x[indices]
        apart = np.linalg.norm(points[:, None] - points[None], axis=2)
        return np.min(apart[np.triu_indices(len(points), 1)])

    spread = [nearest_two(NESTED["maximin_lhs"](x, 12, s)[:prefix]) for s in range(10)]
    chance = [nearest_two(NESTED["random"](x, prefix, s)) for s in range(60)]
    assert np.median(spread) > 1.5 * np.median(chance)


def test_the_hypercube_fills_every_row_and_column():
    grid = np.linspace(0, 1, 201)
    x = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    chosen = x[NESTED["maximin_lhs"](x, 8, 3)]
    for k in range(2):
        rows = np.minimum((chosen[:, k] * 8).astype(int), 7)
        # A point within half a grid step of an edge may fall beside it.
        assert len(set(rows.tolist())) >= 7
