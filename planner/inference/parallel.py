"""Work whose items do not need one another, on two cores."""

import multiprocessing
import os
import pickle
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import cache
from typing import Any, TypeVar
from uuid import uuid4

import cloudpickle
from loky import ProcessPoolExecutor
from threadpoolctl import threadpool_limits

POLL_S = 0.02
NO_LEAK = {"LOKY_MAX_MEMORY_LEAK_SIZE": "1e15"}  # what it caches, in bytes, is none
T = TypeVar("T")
R = TypeVar("R")


def parallel_map(
    work: Callable[[T], R],
    items: Sequence[T],
    done: Callable[[int, int], None] = lambda number, count: None,
) -> list[R]:
    """What `work` makes of each item, in their order.

    This process takes items from the front, a helper process from the end: `work`, items and
    results are pickled. (Threads would wait for the interpreter, and XLA takes one at a time.) The
    helper is started by the first call, is given something once it is there, and kept; its death
    costs nothing but time. There is none in a process that is itself one of many.

    `done` is told the number of each item done here, and how many are done by now. BLAS has one
    thread meanwhile: the products are too small for more.
    """
    waiting, out = deque(range(len(items))), dict[int, R]()

    def here(numbers: Iterable[int]) -> None:
        try:
            for number in numbers:
                out[number] = work(items[number])
                done(number, len(out))
        finally:
            waiting.clear()  # after an error nothing more is begun

    with threadpool_limits(1):
        if len(items) > 1 and _has_cores():
            # At once: later, work that is done here may be changing what it holds.
            pickled = cloudpickle.dumps(work), [cloudpickle.dumps(item) for item in items]
            with ThreadPoolExecutor(1) as other:
                helped = other.submit(_helped, waiting, *pickled, out)
                here(_taken(waiting.popleft))
                helped.result()
        here(number for number in range(len(items)) if number not in out)
    return [out[number] for number in range(len(items))]


def _taken(following: Callable[[], int]) -> Iterator[int]:
    """One after the other, as long as there are any."""
    with suppress(IndexError):
        while True:
            yield following()


def _helped(waiting: deque[int], work: bytes, items: Sequence[bytes], out: dict[int, Any]) -> None:
    """Have the helper do items from the end, once there is one, until it dies."""
    pool, begun = _helper()
    while waiting and not begun.done():
        wait([begun], timeout=POLL_S)
    if not waiting:
        return
    name = uuid4().hex
    try:
        pool.submit(_keep, name, work).result()
        for number in _taken(waiting.pop):
            out[number] = pool.submit(_answer, name, items[number]).result()
    except BrokenProcessPool:
        _helper.cache_clear()
    except BaseException:
        waiting.clear()
        raise
    finally:
        with suppress(BrokenProcessPool):
            pool.submit(_forget, name)


_kept: dict[str, Callable] = {}  # in the helper, which is sent each work once


def _keep(name: str, work: bytes) -> None:
    _kept[name] = pickle.loads(work)


def _answer(name: str, item: bytes) -> Any:
    return _kept[name](pickle.loads(item))


def _forget(name: str) -> None:
    del _kept[name]


def cores() -> int:
    """How many cores this process may use, where the system says; else how many there are."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _has_cores() -> bool:
    return cores() > 1 and multiprocessing.parent_process() is None


@cache
def _helper() -> tuple[ProcessPoolExecutor, Future[None]]:
    """The process, and what is done once it has started."""
    pool = process()
    return pool, pool.submit(_nothing)


def process(begun: Callable[..., object] | None = None, *given: Any) -> ProcessPoolExecutor:
    """Another process, which ends with this one; it first calls `begun`, if named, with `given`."""
    # Of loky: others run a script that has no guard for its main part once more.
    started = begun or _nothing, given
    return ProcessPoolExecutor(1, timeout=None, initializer=_begin, initargs=started, env=NO_LEAK)


def _nothing() -> None:
    """What a helper does first."""


def _begin(begun: Callable[..., object], given: tuple) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the other process's to handle
    threadpool_limits(1)
    begun(*given)
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()


def _end_with(parent: int) -> None:
    """A helper does not outlive a process that is killed."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)
