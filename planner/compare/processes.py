"""Work on the processes of this machine; the death of one costs the item that it worked on."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any

from planner.errors import PlannerError
from planner.inference import parallel

DEFAULT_WORKERS = 2  # processes, unless the user says otherwise
ATTEMPTS = 3  # at an item whose process died


@dataclass(frozen=True)
class Failure:
    """Why an item gave nothing, in one sentence."""

    reason: str


def each(
    function: Callable[[Any, Any], Any],
    shared: Any,
    items: Sequence[Any],
    workers: int = DEFAULT_WORKERS,
    scheduler: str | None = None,
) -> Iterator[tuple[int, Any]]:
    """Index and function(shared, item), or its Failure, of every item as they come.

    On the Dask cluster of a scheduler's address, if that is named.
    """
    if scheduler is not None:
        from planner.compare import cluster

        yield from cluster.each(function, shared, items, scheduler)
        return
    waiting, idle, busy = deque((index, 1) for index in range(len(items))), [], {}
    try:
        while waiting or busy:
            while waiting and len(busy) < workers:
                process = idle.pop() if idle else parallel.process(_hold, function, shared)
                future = process.submit(_answer, items[waiting[0][0]])
                busy[future] = process, *waiting.popleft()
            for future in wait(busy, return_when=FIRST_COMPLETED).done:
                process, index, tries = busy.pop(future)
                try:
                    answer = future.result()
                    idle.append(process)
                except BrokenProcessPool:
                    if tries < ATTEMPTS:
                        waiting.appendleft((index, tries + 1))
                        continue
                    answer = Failure(f"The process that ran it died {ATTEMPTS} times.")
                yield index, answer
    finally:
        for process in (*idle, *(process for process, *_ in busy.values())):
            process.shutdown(kill_workers=True)


_held: list[Any] = []


def _hold(*sent: Any) -> None:
    """In a process: what all of its items need."""
    _held.extend(sent)


def _answer(item: Any) -> Any:
    function, shared = _held
    return attempt(function, shared, item)


def attempt(function: Callable[[Any, Any], Any], shared: Any, item: Any) -> Any:
    """function(shared, item), or the Failure that it ended in."""
    try:
        return function(shared, item)
    except PlannerError as error:
        return Failure(str(error))
    except Exception as error:  # one item's fault must not end the study
        return Failure(f"It failed inside ({type(error).__name__}: {error}).")
