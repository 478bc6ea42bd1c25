"""Work whose items do not need one another, on two cores."""

import multiprocessing
import os
import pickle
import signal
import threading
import time
from collections import OrderedDict, deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import cache
from typing import Any, Generic, TypeVar
from uuid import uuid4

import cloudpickle
from loky import ProcessPoolExecutor
from threadpoolctl import threadpool_limits

POLL_S = 0.02
KEPT = 8  # functions that a helper remembers
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
    waiting, out = deque(range(len(items))), {}

    def here(number: int) -> None:
        out[number] = work(items[number])
        done(number, len(out))

    with threadpool_limits(1):
        if len(items) < 2 or not _has_cores():
            _take(waiting, waiting.popleft, here)
        else:
            asked = _Asked(work, items)

            def elsewhere(number: int) -> None:
                out[number] = asked(number)

            with ThreadPoolExecutor(1) as other:
                helped = other.submit(_once_begun, waiting, elsewhere)
                _take(waiting, waiting.popleft, here)
                helped.result()
    return [out[number] for number in range(len(items))]


def _take(waiting: deque[int], following: Callable[[], int], call: Callable[[int], None]) -> None:
    """One after the other, as long as there are any; after an error nothing more is begun."""
    try:
        while waiting:
            try:
                number = following()
            except IndexError:  # the other was faster
                return
            call(number)
    except BaseException:
        waiting.clear()
        raise


def _once_begun(waiting: deque[int], call: Callable[[int], None]) -> None:
    """From the end, once there is a helper."""
    _, begun = _helper()
    while waiting and not begun.done():
        wait([begun], timeout=POLL_S)
    if waiting:
        _take(waiting, waiting.pop, call)


class _Asked(Generic[T, R]):
    """Work that is done by the helper, to whom it is sent once; here if that dies.

    All is pickled at once: later, work that is done here may be changing what it holds.
    """

    def __init__(self, work: Callable[[T], R], items: Sequence[T]):
        self.work, self.items, self.name, self.sent = work, items, uuid4().hex, False
        self.pickled = cloudpickle.dumps(work)
        self.pickled_items = [cloudpickle.dumps(item) for item in items]

    def __call__(self, number: int) -> R:
        whole, item = None if self.sent else self.pickled, self.pickled_items[number]
        try:
            found = _helper()[0].submit(_answer, self.name, whole, item).result()
        except BrokenProcessPool:
            _helper.cache_clear()
            self.sent = False
            return self.work(self.items[number])
        except _ForgottenError:
            self.sent = False
            return self(number)
        self.sent = True
        return found


class _ForgottenError(Exception):
    """The helper no longer has what it was sent."""


_known: OrderedDict[str, Callable] = OrderedDict()


def _answer(name: str, work: bytes | None, item: bytes) -> Any:
    """In the helper."""
    if work is not None:
        _known[name] = pickle.loads(work)
        while len(_known) > KEPT:
            _known.popitem(last=False)
    if name not in _known:
        raise _ForgottenError
    return _known[name](pickle.loads(item))


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
