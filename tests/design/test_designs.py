"""Nested designs over a pool."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.design.space_filling import NESTED


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
