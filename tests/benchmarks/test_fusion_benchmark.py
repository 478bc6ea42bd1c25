"""Nobody waits between hits: what a refit, a prediction and a proposal take, on one core.

`pytest -m slow -s tests/benchmarks/test_fusion_benchmark.py` prints the table. The bounds are
several times the times aimed at, so that a busy machine does not fail them.
"""

import os
import subprocess
import sys
import time

import numpy as np
import pytest

from planner.acquire.propose import propose
from planner.fusion.surrogate import fit_surrogate
from test_fusion import observed, simulated

X = np.random.default_rng(9).random((1000, 2))


def fastest(action, repeats=3):
    """Least of a few wall times in s."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return min(times)


@pytest.mark.slow
def test_times_of_a_step():
    low = simulated(X)
    print("\n  n   refit  predict 1000  propose of 1000   [s]")
    for n, bound in ((10, 0.5), (20, 1.2), (40, 4.0)):
        surrogate = fit_surrogate(observed(n, 0))
        refit = fastest(lambda n=n: fit_surrogate(observed(n, 1)))
        predict = fastest(lambda s=surrogate: s.predict(X, low))
        pick = fastest(lambda s=surrogate: propose("integrated_variance", s, X, low, 1, None, 0))
        print(f"{n:3d}  {refit:6.3f}  {predict:12.3f}  {pick:15.3f}")
        assert refit < bound
        assert predict < 2.0
        assert pick < 2.0


@pytest.mark.slow
def test_times_of_a_start(tmp_path):
    code = (
        "import time; a = time.perf_counter()\n"
        "from test_fusion import observed, simulated\n"
        "from planner.fusion.surrogate import fit_surrogate\n"
        "b = time.perf_counter()\n"
        "x = observed(9, 1).x; fit_surrogate(observed(5, 0)).predict(x, simulated(x))\n"
        "print(b - a, time.perf_counter() - b)"
    )
    environment = {
        **os.environ,
        "XDG_CACHE_HOME": str(tmp_path),
        "PYTHONPATH": os.pathsep.join(p for p in sys.path if p),
    }
    first = []
    for what in ("nothing cached", "cached"):
        done = subprocess.run(
            [sys.executable, "-c", code],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        imports, fit = (float(v) for v in done.stdout.split())
        print(f"\n{what}: imports {imports:.2f} s, first fit and prediction {fit:.2f} s")
        first.append(fit)
    assert first[0] < 15
    assert first[1] < first[0]
