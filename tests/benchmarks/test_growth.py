"""How long a first fit takes: `pytest -m slow -s tests/benchmarks/test_growth.py` prints the times.

Bounds are several times what is aimed at, so that a busy machine does not fail them.
"""

import subprocess
import sys

import pytest

from tests.support.outside import with_tests

pytestmark = pytest.mark.slow


def test_times_of_a_start(tmp_path):
    code = (
        "import time; a = time.perf_counter()\n"
        "from tests.support.surrogates import observed, simulated\n"
        "from planner.surrogate.modal_surrogate import fit_surrogate\n"
        "b = time.perf_counter()\n"
        "x = observed(9, 1).x; fit_surrogate(observed(5, 0)).predict(x, simulated(x))\n"
        "print(b - a, time.perf_counter() - b)"
    )
    environment = {**with_tests(), "XDG_CACHE_HOME": str(tmp_path)}
    for what, bound in (("nothing cached", 6.0), ("cached", 3.0)):
        done = subprocess.run(
            [sys.executable, "-c", code],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        imports, fit = (float(v) for v in done.stdout.split())
        print(f"\n{what}: imports {imports:.2f} s, first fit and prediction {fit:.2f} s")
        assert imports + fit < bound
