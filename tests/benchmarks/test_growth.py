"""How long a fit takes at a start, and as the campaign grows, a peer in the same run.

`pytest -m slow -s tests/benchmarks/test_growth.py` prints the times. Bounds are several times what
is aimed at, so that a busy machine does not fail them.
"""

import subprocess
import sys

import numpy as np
import pytest

from planner.surrogate.modal_surrogate import fit_surrogate
from tests.support.outside import with_tests
from tests.support.surrogates import observed, simulated, true_hz
from tests.support.timing import spent

pytestmark = pytest.mark.slow

SCALE = 1.12


@pytest.mark.filterwarnings("ignore")  # the peer's optimiser meets its bounds
@pytest.mark.parametrize("poses", [30, 100, 200, 500])
def test_fit_and_prediction_against_scikit_learn(poses):
    """Four frequencies and dampings averaged over hyperparameters, against one estimate each."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

    seen = observed(poses, 0, SCALE)
    x = np.random.default_rng(1).random((500, 2))
    fitted, _, ours = spent(lambda: fit_surrogate(seen, residues=False))
    found, _, asked = spent(lambda: fitted.predict(x, simulated(x)))
    targets = [np.log(seen.frequency_hz), np.log(seen.damping_ratio)]

    def peer():
        predicted = []
        for y in np.concatenate(targets, axis=1).T:
            kernel = ConstantKernel(0.01) * Matern([1.0, 1.0], nu=2.5) + WhiteKernel(1e-6)
            model = GaussianProcessRegressor(kernel, normalize_y=True).fit(seen.x, y)
            predicted.append(model.predict(x, return_std=True)[0])
        return np.exp(np.array(predicted[:4]).T)

    theirs, _, took = spent(peer)
    truth = true_hz(x, SCALE)
    rmse = [100 * np.sqrt(np.mean((f / truth - 1) ** 2)) for f in (found.frequency_hz, theirs)]
    print(
        f"\n{poses} poses: fit {ours:.2f} s and 500 predictions {asked:.2f} s CPU, RMSE "
        f"{rmse[0]:.3f} %; scikit-learn {took:.2f} s, {rmse[1]:.3f} %, ratio "
        f"{took / (ours + asked):.1f}"
    )
    assert rmse[0] < 1.1 * rmse[1]


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
