"""Fits that do not need one another, two at a time: NumPy and LAPACK let other threads run."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from threadpoolctl import threadpool_limits

THREADS = 2
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
