"""Work whose items do not need one another, on two cores: in threads or with a helper process."""

import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import cache
from typing import TypeVar

from threadpoolctl import threadpool_limits

THREADS = 2
POLL_S = 0.02
T = TypeVar("T")
R = TypeVar("R")


def side_by_side(
    work: Callable[[T], R], items: Sequence[T], done: Callable[[int], None] = lambda number: None
) -> list[R]:
    """What `work` makes of each item, in their order; `done` is told the number of each.

    It runs in threads, on what none of them changes; an error or Ctrl-C waits for what has begun.
    BLAS has one thread meanwhile in the whole process: the products are too small for more.
    """
    out = []
    with threadpool_limits(1), ThreadPoolExecutor(THREADS) as pool:
        for number, result in enumerate(pool.map(work, items)):
            out.append(result)
            done(number)
    return out


def with_helper(work: Callable[[T], R], items: Sequence[T]) -> list[R]:
    """What `work` makes of each item, in their order, where threads would wait for each other.

    This process takes items from the front, a helper process from the end: `work`, items and
    results are pickled. The helper is started by the first call, is given something once it is
    there, and kept. Its death costs nothing but time; there is none in a process that is itself
    one of many.
    """
    if len(items) < 2 or not _has_cores():
        return [work(item) for item in items]
    waiting, out = deque(enumerate(items)), {}

    def take(following: Callable[[], tuple[int, T]], call: Callable[[T], R]) -> None:
        while waiting:
            with suppress(IndexError):  # the other was faster
                number, item = following()
                out[number] = call(item)

    def elsewhere(item: T) -> R:
        try:
            return _helper()[0].submit(work, item).result()
        except BrokenProcessPool:
            _helper.cache_clear()
            return work(item)

    def help_() -> None:
        _, begun = _helper()
        while waiting and not begun.done():
            wait([begun], timeout=POLL_S)
        take(waiting.pop, elsewhere)

    with threadpool_limits(1), ThreadPoolExecutor(1) as other:
        helped = other.submit(help_)
        try:
            take(waiting.popleft, work)
        finally:
            waiting.clear()
        helped.result()
    return [out[number] for number in range(len(items))]


def _has_cores() -> bool:
    return (os.cpu_count() or 1) > 1 and multiprocessing.parent_process() is None


@cache
def _helper() -> tuple[ProcessPoolExecutor, Future[None]]:
    """The process, and what is done once it has started."""
    # Spawned: forking a process with compiled JAX code in it may hang.
    spawned = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(1, mp_context=spawned, initializer=_begin)
    return pool, pool.submit(_nothing)


def _nothing() -> None:
    """What a helper does first."""


def _begin() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the other process's to handle
    threadpool_limits(1)
