"""Work on two cores: in order, told of, stopped by an error; a helper that may come late or die."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from itertools import pairwise

import pytest

from planner.inference import parallel as module
from planner.inference.parallel import cores, parallel_map

HAS_CORES = module._has_cores  # before conftest.py, where there are many workers, says otherwise


def who(seconds: float) -> tuple[float, int]:
    time.sleep(seconds)
    return seconds, os.getpid()


def fail(number: int) -> int:
    time.sleep(0.02)
    if number in (1, 998):  # one of them here, the other by the helper
        raise IndexError("as asked")
    return number


def die_elsewhere(here: int) -> int:
    if os.getpid() != here:
        os.kill(os.getpid(), signal.SIGKILL)
    return here


def helped(seconds: list[float]) -> list[tuple[float, int]]:
    return parallel_map(who, seconds)


def there(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.fixture(autouse=True)
def as_without_other_workers(monkeypatch):
    monkeypatch.setattr(module, "_has_cores", HAS_CORES)


@pytest.fixture
def helper():
    """A helper that has started, where there are two cores."""
    assert module._helper()[1].result(60) is None


def test_a_helper_takes_its_share_in_order(helper):
    seconds = [0.05 + 0.001 * n for n in range(20)]
    found = parallel_map(who, seconds)
    assert [s for s, _ in found] == seconds
    assert found[0][1] == os.getpid()
    assert len({process for _, process in found}) == min(cores(), 2)


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system has no such thing")
def test_there_is_no_helper_where_only_one_core_may_be_used(helper):
    all_cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(all_cores)})
    try:
        assert {process for _, process in helped([0.01] * 20)} == {os.getpid()}
    finally:
        os.sched_setaffinity(0, all_cores)


def test_what_is_done_is_told(helper):
    told: list[tuple[int, int]] = []
    parallel_map(who, [0.02] * 9, lambda number, count: told.append((number, count)))
    numbers, counts = zip(*told, strict=True)
    assert list(numbers) == list(range(len(numbers)))  # those done here, in order
    assert all(a < b <= 9 for a, b in pairwise(counts))


def test_a_helper_keeps_nothing(helper):
    parallel_map(abs, range(-9, 0))
    with pytest.raises(IndexError):
        parallel_map(fail, range(1000))
    assert module._helper()[0].submit(lambda: module._kept).result() == {}


class Lazy:
    """Gets attributes as it is used, as `cached_property` does."""

    def called(self, number: int) -> int:
        time.sleep(0.001)
        setattr(self, f"seen_{number}", number)
        return number


def test_what_is_sent_may_change_meanwhile(helper):
    lazy = Lazy()
    for n in range(2000):
        setattr(lazy, f"before_{n}", n)
    for _ in range(5):
        assert parallel_map(lazy.called, range(100)) == list(range(100))


def test_nothing_waits_for_a_helper_that_is_not_there_yet(monkeypatch):
    pool = module._helper()[0]
    monkeypatch.setattr(module, "_helper", lambda: (pool, module.Future()))
    assert {process for _, process in parallel_map(who, [0.0] * 5)} == {os.getpid()}


def test_a_helper_that_dies_costs_nothing(helper):
    assert parallel_map(die_elsewhere, [os.getpid()] * 50) == [os.getpid()] * 50
    assert parallel_map(abs, range(-9, 0)) == list(range(9, 0, -1))


@pytest.mark.parametrize("items", [range(1000), range(2, 1000), range(3)])
def test_an_error_ends_it(helper, items):
    started = time.monotonic()
    with pytest.raises(IndexError, match="as asked"):
        parallel_map(fail, items)
    assert time.monotonic() - started < 5  # all would take ten seconds
    assert parallel_map(abs, [-1]) == [1]


def test_a_helper_ends_with_a_process_that_is_killed(tmp_path):
    if cores() < 2:
        pytest.skip("there is no helper")
    script = tmp_path / "unguarded.py"  # as users write them; it must not run twice either
    script.write_text(
        "import os, time\n"
        "from planner.inference import parallel as module\n"
        "def who(x):\n"
        "    time.sleep(0.01)\n"
        "    return os.getpid()\n"
        "module._helper()[1].result()\n"
        "found = set(module.parallel_map(who, range(99))) - {os.getpid()}\n"
        "print(*found, flush=True)\n"
        "time.sleep(100)\n"
    )
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        helper = int(process.stdout.readline())
        process.kill()
    for _ in range(100):
        if not there(helper):
            return
        time.sleep(0.1)
    raise AssertionError("the helper is still there")


def test_a_process_of_many_has_no_helper():
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        found = pool.apply(helped, ([0.01] * 10,))
    assert len({process for _, process in found}) == 1


def test_a_helper_has_no_helper(helper):
    found = parallel_map(helped, [[0.01] * 5] * 20)
    there = [{process for _, process in one} for one in found if one[0][1] != os.getpid()]
    assert all(len(one) == 1 for one in there)
