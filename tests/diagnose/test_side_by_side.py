"""Fits two at a time: in order, told of, stopped by an error; a model that threads share."""

import sys
import threading
import time

import numpy as np
import pytest

from known_robots import KR10
from planner.diagnose.side_by_side import side_by_side
from planner.robot.elastic import ElasticModel
from planner.robot.robot import Robot


@pytest.fixture
def often():
    """Threads take turns as often as they can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def test_results_come_in_order_whoever_is_first():
    second_done = threading.Event()

    def work(number: int) -> int:
        if number == 0:  # ends only once the second has: so they do run side by side
            assert second_done.wait(30)
        if number == 1:
            second_done.set()
        return number**2

    told: list[int] = []
    assert side_by_side(work, range(9), told.append) == [n**2 for n in range(9)]
    assert told == list(range(9))
    assert side_by_side(work, []) == []


def test_an_error_ends_it():
    started: list[int] = []

    def work(number: int) -> None:
        started.append(number)
        if number == 3:
            raise ValueError("the third")
        time.sleep(0.01)

    with pytest.raises(ValueError, match="the third"):
        side_by_side(work, range(1000))
    assert len(started) < 1000


@pytest.mark.parametrize("gravity", [False, True])
def test_threads_may_share_an_elastic_model(tmp_path, often, gravity):
    path = KR10.write(tmp_path, 2)
    if gravity:
        path.write_text("geometric_stiffness = true\n" + path.read_text())
    model = ElasticModel(Robot.load(path))
    poses = [KR10.poses(3, seed) for seed in range(200)]

    def matrices(q: np.ndarray) -> tuple[np.ndarray, ...]:
        found = model.matrices(q)
        return found.mass, found.hit, found.sensor, found.geometric, model.body_jacobians(q)

    for alone, shared in zip(map(matrices, poses), side_by_side(matrices, poses), strict=True):
        for one, other in zip(alone, shared, strict=True):
            assert np.array_equal(one, other)
