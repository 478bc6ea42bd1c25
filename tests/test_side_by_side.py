"""Work on two cores: in order, told of, stopped by an error; a helper that may come late or die."""

import multiprocessing
import os
import signal
import sys
import threading
import time

import numpy as np
import pytest

from known_robots import KR10
from planner import side_by_side as module
from planner.robot.elastic import ElasticModel
from planner.robot.robot import Robot
from planner.side_by_side import side_by_side, with_helper


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


def who(seconds: float) -> tuple[float, int]:
    time.sleep(seconds)
    return seconds, os.getpid()


def fail(number: int) -> int:
    time.sleep(0.02)
    if number in (1, 38):  # one of them here, the other by the helper
        raise ValueError("as asked")
    return number


def die_elsewhere(here: int) -> int:
    if os.getpid() != here:
        os.kill(os.getpid(), signal.SIGKILL)
    return here


def helped(seconds: list[float]) -> list[tuple[float, int]]:
    return with_helper(who, seconds)


@pytest.fixture
def helper():
    """A helper that has started, where there are two cores."""
    assert module._helper()[1].result(60) is None


def test_a_helper_takes_its_share_in_order(helper):
    seconds = [0.05 + 0.001 * n for n in range(20)]
    found = with_helper(who, seconds)
    assert [s for s, _ in found] == seconds
    assert found[0][1] == os.getpid()
    assert len({process for _, process in found}) == min(os.cpu_count() or 1, 2)


def test_nothing_waits_for_a_helper_that_is_not_there_yet(monkeypatch):
    pool = module._helper()[0]
    monkeypatch.setattr(module, "_helper", lambda: (pool, module.Future()))
    assert {process for _, process in with_helper(who, [0.0] * 5)} == {os.getpid()}


def test_a_helper_that_dies_costs_nothing(helper):
    assert with_helper(die_elsewhere, [os.getpid()] * 50) == [os.getpid()] * 50
    assert with_helper(abs, range(-9, 0)) == list(range(9, 0, -1))


def test_an_error_in_helped_work_ends_it(helper):
    with pytest.raises(ValueError, match="as asked"):
        with_helper(fail, range(40))
    assert with_helper(abs, [-1]) == [1]


def test_a_process_of_many_has_no_helper():
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        found = pool.apply(helped, ([0.01] * 10,))
    assert len({process for _, process in found}) == 1
