"""Work on the processes of this machine; the death of one costs the item that it worked on."""

import multiprocessing
import signal
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from planner.errors import PlannerError

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
) -> Iterator[tuple[int, Any]]:
    """Index and function(shared, item), or its Failure, of every item as they come.

    Processes are spawned: forking a process with compiled JAX code in it may hang.
    """
    waiting = deque((index, 1) for index in range(len(items)))
    team: dict[Any, _Worker] = {}  # by the connection to it
    try:
        while waiting or team:
            while waiting and len(team) < workers:
                worker = _Worker(function, shared)
                worker.give(items, *waiting.popleft())
                team[worker.connection] = worker
            for connection in wait(list(team)):
                worker = team[connection]
                index, attempt = worker.busy
                try:
                    answer = worker.connection.recv()
                except (EOFError, OSError):  # closed, or reset
                    team.pop(worker.connection).stop()
                    if attempt < ATTEMPTS:
                        waiting.appendleft((index, attempt + 1))
                    else:
                        yield index, Failure(f"The process that ran it died {ATTEMPTS} times.")
                    continue
                if waiting:
                    worker.give(items, *waiting.popleft())
                else:
                    team.pop(worker.connection).stop()
                yield index, answer
    finally:
        for worker in team.values():
            worker.stop()


class _Worker:
    """A process and this end of the pipe to it; `busy` is the item's index and the attempt."""

    def __init__(self, function: Callable[[Any, Any], Any], shared: Any):
        context = multiprocessing.get_context("spawn")
        self.connection, other = context.Pipe()
        self.process = context.Process(target=_work, args=(other, function, shared), daemon=True)
        self.process.start()
        other.close()  # so that the end of the process is the end of the pipe
        self.busy = (-1, 0)

    def give(self, items: Sequence[Any], index: int, attempt: int) -> None:
        self.busy = index, attempt
        with suppress(BrokenPipeError):  # it died; so says the pipe's other direction
            self.connection.send(items[index])

    def stop(self) -> None:
        self.connection.close()
        self.process.kill()
        self.process.join()


def _work(connection: Connection, function: Callable[[Any, Any], Any], shared: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    while True:
        try:
            item = connection.recv()
        except (EOFError, OSError):  # closed, or reset
            return
        connection.send(attempt(function, shared, item))


def attempt(function: Callable[[Any, Any], Any], shared: Any, item: Any) -> Any:
    """function(shared, item), or the Failure that it ended in."""
    try:
        return function(shared, item)
    except PlannerError as error:
        return Failure(str(error))
    except Exception as error:  # one item's fault must not end the study
        return Failure(f"It failed inside ({type(error).__name__}: {error}).")
