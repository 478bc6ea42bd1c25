"""Permutation tests: groups, and values in an order, against members shared out at random."""

import numpy as np
import pytest

from planner.modal import exchangeable

DRAWS = 500


def chances(course: float, groups: int = 12) -> tuple[float, float]:
    """Of groups of six values in three pairs, by pairs and by the order of the pairs' means."""
    rng = np.random.default_rng(3)
    told = np.zeros((2, 1 + DRAWS))
    for _ in range(groups):
        values = rng.standard_normal((6, 5)) + course * np.repeat(np.arange(3), 2)[:, None]
        pairs = np.repeat(np.arange(3), 2)
        means = values.reshape(3, 2, 5).mean(axis=1)
        both = (
            exchangeable.between(values, pairs, DRAWS, rng),
            exchangeable.ordered(means, DRAWS, rng),
        )
        told += [[measured, *shared] for measured, shared in both]
    return exchangeable.chance(told[0, 0], told[0, 1:]), exchangeable.chance(
        told[1, 0], told[1, 1:]
    )


def test_a_course_is_told_by_groups_and_by_order():
    assert max(chances(2.0)) < 0.01


def test_without_one_nothing_is_told():
    assert min(chances(0.0)) > 0.02


@pytest.mark.parametrize("back", [False, True])
def test_a_straight_course_leaves_nothing_there_and_back(back):
    values = np.arange(4.0)[:, None] * np.ones(3)
    told, shared = exchangeable.ordered(
        values[::-1] if back else values, DRAWS, np.random.default_rng(1)
    )
    assert told > 10
    assert np.mean(shared > told - 1e-9) == pytest.approx(2 / 24, abs=0.05)
