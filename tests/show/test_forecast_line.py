"""What the session says of the time to go holds, or it says nothing."""

import numpy as np
import pytest

from planner.design.stopping import percent
from planner.report.predictions import ExpectedMode
from planner.session.session_text import MOST_TOLD, poses_to_go, progress_line


def test_a_steady_fall_is_followed_to_the_target():
    history = [8.0, 4.0, 2.0, 1.0]
    assert poses_to_go(history, 0.25, 3) == (2, 2)
    said = progress_line(history, 0.25, 120.0, 3).plain
    assert said == "2.0 min per pose; 2 more poses, 4 min to go"


@pytest.mark.parametrize(
    "history", [[2.5, 0.7, 34.6, 0.9], [2.5, 2.49, 2.48, 2.47], [1.0, 2.0, 4.0, 8.0], [3.0, 1.0]]
)
def test_without_a_trend_nothing_is_said_of_poses_and_minutes(history):
    said = progress_line(history, 0.1, 180.0, 3).plain
    assert "more pose" not in said
    assert "to go" not in said
    assert "no trend yet" in said


def test_ranges_hold_the_truth_about_as_often_as_they_should():
    """Falls by a third, with scatter: two standard errors' width holds most of the true counts."""
    rng, held, told = np.random.default_rng(0), 0, 0
    for _ in range(300):
        falls = np.log(1.5) + 0.25 * rng.standard_normal(60)
        path = 10 * np.exp(-np.cumsum(falls))
        left = poses_to_go(path[:6].tolist(), 0.3, 3)
        if left is None or path[5] <= 0.3:
            continue
        true = int(np.argmax(path[6:] <= 0.3)) + 1
        low, high = left
        assert 1 <= low <= (high or MOST_TOLD) <= MOST_TOLD
        told += 1
        held += low <= true and (high is None or true <= high)
    assert told > 200
    assert held / told > 0.6


def test_below_the_target_nothing_is_left_but_what_was_asked_at_least():
    assert poses_to_go([1.0, 0.1], 0.5, 2) == (0, 0)
    assert poses_to_go([0.1], 0.5, 3) == (2, 2)
    assert "below the target" in progress_line([1.0, 0.1], 0.5, 60.0, 2).plain


def test_a_damping_of_which_nothing_is_known_is_no_number():
    assert ExpectedMode(10.0, 0.1, 0.133, 2.91).cells[1] == "not known"
    assert ExpectedMode(10.0, 0.1, 0.03, 0.002).cells[1] == "3.00 ± 0.20"


@pytest.mark.parametrize(
    ("value", "said"),
    [(0.0321, "0.032 %"), (1.44, "1.4 %"), (46.3, "46 %"), (99.6, "100 %"), (113.0, "more than "
     "100 %"), (1.7e6, "more than 100 %"), (0.0, "0 %")],
)  # fmt: skip
def test_percentages_are_read_without_powers_of_ten(value, said):
    assert percent(value) == said
