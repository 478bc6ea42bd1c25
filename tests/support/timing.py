"""Times of benchmarks, and what JAX compiles, counted."""

import statistics
import time
from collections.abc import Iterator
from contextlib import contextmanager

import jax

COMPILED = "/jax/core/compile/backend_compile_duration"  # told by JAX, if kept on the disk too


def seconds(action, repeats=7):
    """Median after one warm-up."""
    action()
    taken = []
    for _ in range(repeats):
        started = time.perf_counter()
        action()
        taken.append(time.perf_counter() - started)
    return statistics.median(taken)


def spent(act):
    """What it returns, its wall time and its processor time in s."""
    begun, own = time.perf_counter(), time.process_time()
    value = act()
    return value, time.perf_counter() - begun, time.process_time() - own


@contextmanager
def compilations() -> Iterator[list[float]]:
    """The duration in seconds of each compilation by XLA inside the with-block."""
    found: list[float] = []

    def note(event: str, duration_secs: float, **_: str | int) -> None:
        if event == COMPILED:
            found.append(duration_secs)

    jax.monitoring.register_event_duration_secs_listener(note)
    try:
        yield found
    finally:
        jax.monitoring.unregister_event_duration_listener(note)
