"""Times of benchmarks."""

import statistics
import time


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
