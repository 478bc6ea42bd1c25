"""Wall times of benchmarks."""

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
