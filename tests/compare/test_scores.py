"""Scores of predictions, and the statistics of learning curves."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planner.compare.curves import Curves, baseline_of, paired, score
from planner.compare.tasks import Run

HZ = np.array([[10.0, 20.0], [11.0, 24.0], [12.0, 22.0]])
SMALL = np.full_like(HZ, 1e-6)


def test_errors_are_relative_and_intervals_hold_both_sds():
    assert score(HZ, SMALL, HZ, SMALL) == pytest.approx((0.0, 1.0, 1.0))
    found = score(1.01 * HZ, 0.01 * HZ, HZ, 0 * HZ)
    assert found.frequency_rmse_percent == pytest.approx(1.0)
    assert found.coverage95 == 1.0
    assert score(1.03 * HZ, 0.01 * HZ, HZ, 0 * HZ).coverage95 == 0.0
    assert score(1.03 * HZ, 0.01 * HZ, HZ, 0.02 * HZ).coverage95 == 1.0
    mean = np.tile(HZ.mean(axis=0), (3, 1))
    assert score(mean, SMALL, HZ, SMALL).r2 == pytest.approx(0.0)


def test_modes_that_were_not_found_do_not_count():
    missing, off = HZ.copy(), HZ.copy()
    missing[0, 1], off[0, 1] = np.nan, 99.0
    assert score(off, SMALL, missing, SMALL) == pytest.approx((0.0, 1.0, 1.0))


@given(st.floats(0.1, 10.0), st.integers(0, 1000))
def test_the_unit_of_frequency_does_not_matter(scale, seed):
    rng = np.random.default_rng(seed)
    predicted, sd = HZ * rng.normal(1, 0.02, HZ.shape), 0.02 * HZ
    a, b = (score(s * predicted, s * sd, s * HZ, s * SMALL) for s in (1.0, scale))
    assert a == pytest.approx(b)


def run(seed: int, errors: list[float]) -> Run:
    t = len(errors)
    ones = (1.0,) * t
    n = tuple(range(3, 3 + t))
    return Run("any", seed, ("P",) * t, n, tuple(errors), ones, ones, ones, 1.0, 1.0)


def test_measurements_to_one_percent():
    curves = Curves.of([run(0, [3, 0.9, 0.5]), run(1, [3, 2, 0.8]), run(2, [3, 2, 1.5])])
    assert curves.to_goal == 5
    assert curves.each_to_goal.tolist() == [4, 5, 6]  # 6: not within the budget
    assert curves.minutes_to_goal == 1.0
    never = Curves.of([run(0, [3, 2, 1.01])])
    assert never.to_goal is None
    assert never.minutes_to_goal is None


def test_differences_are_taken_seed_by_seed():
    rng = np.random.default_rng(1)
    level = rng.uniform(1, 9, 20)  # seeds differ far more than strategies do
    slow = Curves.of([run(s, [level[s], level[s]]) for s in range(20)])
    quick = Curves.of([run(s, [level[s], level[s] - 0.2 - 0.01 * s]) for s in range(19, -1, -1)])
    found = paired(quick, slow)
    assert found["seeds"] == 20
    assert found["difference_percent"][0] == 0
    assert found["difference_percent"][1] == pytest.approx(-0.295)
    low, high = found["difference_percent_interval95"][1]
    assert -0.39 <= low < -0.295 < high <= -0.2
    assert low < high < 0


def test_only_seeds_of_both_are_compared():
    a = Curves.of([run(0, [2, 1]), run(2, [4, 3])])
    b = Curves.of([run(1, [9, 9]), run(2, [5, 5])])
    assert paired(a, b)["seeds"] == 1
    assert paired(a, b)["difference_percent"].tolist() == [-1, -2]
    assert paired(a, Curves.of([run(7, [1, 1])])) is None


def test_the_interval_covers_the_true_difference_as_often_as_it_says():
    rng, hits, trials = np.random.default_rng(7), 0, 200
    for _ in range(trials):
        base = rng.uniform(2, 9, 20)
        other = base - 1 + rng.normal(0, 0.5, 20)
        made = (Curves.of([run(s, [x]) for s, x in enumerate(xs)]) for xs in (other, base))
        low, high = paired(*made)["difference_percent_interval95"][0]
        hits += low <= -1 <= high
    assert 0.88 <= hits / trials <= 0.99


def test_the_baseline_is_the_hypercube_where_it_takes_part():
    assert baseline_of(["random", "maximin_lhs"]) == "maximin_lhs"
    assert baseline_of(["random", "sobol"]) == "random"
