"""Nobody waits between hits: what a refit, a prediction and a proposal take, on one core.

`pytest -m slow -s tests/benchmarks/test_fusion_benchmark.py` prints the table. The bounds are
several times the times aimed at, so that a busy machine does not fail them.
"""

import subprocess
import sys
import time

import numpy as np
import pytest

from planner.surrogate.modal_surrogate import ModalObservations, fit_surrogate
from tests.support.outside import with_tests
from tests.support.surrogates import simulated

X = np.random.default_rng(9).random((1000, 2))


def eight_modes(n, seed):
    """Eight modes at n poses: 8 × (frequency, damping, 18 residue parts) = 160 outputs."""
    rng = np.random.default_rng(seed)
    x = rng.random((n, 3))
    low = simulated(x, 8)
    f = 1.1 * low.frequency_hz * (1 + 0.02 * np.sin(4 * x[:, :1]))
    zeta = 0.03 * np.exp(0.1 * rng.standard_normal(f.shape))
    residue = 1.3 * low.residue * (1 + 0.1 * rng.standard_normal((n, 8, 3, 3)))
    sd = np.full(residue.shape, 1e-8)
    return ModalObservations(x, f, 1e-3 * f, zeta, 0.05 * zeta, residue, sd, low)


@pytest.mark.slow
def test_time_of_160_outputs():
    print("\n  n  refit of 160 outputs: wall s, processor s")
    for n in (10, 15, 30):
        fit_surrogate(eight_modes(n, 0))
        start, own = time.perf_counter(), time.process_time()
        for seed in range(3):
            fit_surrogate(eight_modes(n, seed + 1))
        wall, own = (time.perf_counter() - start) / 3, (time.process_time() - own) / 3
        print(f"{n:3d}  {wall:6.2f} {own:6.2f}")
        assert own < 1.5


@pytest.mark.slow
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
