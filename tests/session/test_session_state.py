"""What a session knows beside the campaign, as values."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from planner.session.session_state import SessionState


def model(sd_percent: float, done: bool = False) -> Any:
    stop = SimpleNamespace(frequency_sd_percent=1.0, measurements_min=3, measurements_max=9)
    cell = SimpleNamespace(config=SimpleNamespace(stop=stop))
    return SimpleNamespace(cell=cell, done=done, frequency_sd_percent=np.full(2, sd_percent))


def state(*poses: str) -> Any:
    return SimpleNamespace(used=poses, measurements=dict.fromkeys(poses))


def test_an_import_that_was_taken_back_no_longer_counts():
    once = SessionState().after("P1", model(0.5), state("P1"), 60.0, auto=False)
    assert "2 more poses, 2 min to go" in once.progress
    undone = once.undone(state())
    assert (undone.measured, undone.history, undone.progress) == ((), (), "")
    again = undone.after("P1", model(0.5), state("P1"), 60.0, auto=False)
    assert again.measured == ("P1",)
    assert again.progress == once.progress


def test_poses_of_earlier_sessions_count_towards_the_least_number():
    resumed = SessionState().after(
        "P4", model(0.5, done=True), state("P1", "P2", "P3", "P4"), 60.0, True
    )
    assert "more pose" not in resumed.progress
    assert resumed.stop == "target reached"
    assert resumed.announced


def test_a_session_ends_where_campaign_toml_allows_no_more():
    full = state(*(f"P{k}" for k in range(9)))
    course = SessionState().after("P8", model(5.0), full, 60.0, auto=False)
    assert course.stop == "as many measurements as campaign.toml allows"
    assert not course.announced
