"""Models as published beside public ones of the same model on the same data.

NARGP beside emukit's: same kernels, noise and data. At emukit's hyperparameters both must say the
same. Each finds hyperparameters by its own climb: ours must never end lower, and where both end on
the same peak, predict the same; where ours ends higher, emukit's is not the greatest likelihood.
`pytest -m slow -s tests/benchmarks/test_published_peers.py` prints the tables; the peers run in the
interpreter that PEERS_PYTHON names. PEERS_SEEDS (10) says how many designs per problem.
"""

import importlib.util
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import qmc

from planner.surrogate.kernels import perdikaris
from planner.surrogate.models.likelihood_gp import (
    NARGP,
    Normalisation,
    Samples,
    at_hyperparameters,
    fit_likelihood,
    fit_nargp,
)

SEEDS = int(os.environ.get("PEERS_SEEDS", "10"))
NOISE = 1e-3  # sd over the cheap values' sd: the variance of 1e-6 that emukit's is given
EXPENSIVE = 15
LOW_STARTS, STARTS = 5, 30  # of the levels' climbs; of 30 each is rough at first
SAME_PEAK = 0.15  # difference of log-likelihoods of two climbs that say the same
# Of some hundred: 25 points on a line with next to no noise leave a nearly singular matrix.
LIKELIHOODS = 0.03
DRAWN = 0.02  # what emukit's 2,000 draws of the cheap level leave of an RMSE of 0.3 %

PYTHON = os.environ.get("PEERS_PYTHON", sys.executable)
pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(0),
    pytest.mark.skipif(
        "PEERS_PYTHON" not in os.environ and importlib.util.find_spec("emukit") is None,
        reason="the peers are not installed: pip install 'planner[peers]', or set PEERS_PYTHON",
    ),
]
LOW_POINTS = {1: 25, 2: 50}  # by dimension
TEST_POINTS = 400


@dataclass(frozen=True, eq=False)
class Design:
    """Nested design: x_high is the head of x_low."""

    x_low: np.ndarray
    y_low: np.ndarray
    x_high: np.ndarray
    y_high: np.ndarray
    x_test: np.ndarray
    y_test: np.ndarray


def design(name: str, n: int, seed: int) -> Design:
    """n expensive points of a Latin hypercube; the cheap ones add a scrambled Sobol set."""
    d, high, low = PROBLEMS[name]
    rng = np.random.default_rng(1000 * seed + n)
    x_high = qmc.LatinHypercube(d, rng=rng).random(n)
    sobol = qmc.Sobol(d, scramble=True, rng=rng)
    x_low = np.vstack([x_high, sobol.random_base2(7)[: LOW_POINTS[d] - n]])
    test = qmc.Sobol(d, scramble=True, rng=np.random.default_rng(77))
    x_test = test.random_base2(9)[:TEST_POINTS]
    return Design(x_low, low(x_low), x_high, high(x_high), x_test, high(x_test))


def forrester(x: np.ndarray) -> np.ndarray:
    """Forrester et al. 2007."""
    return (6 * x[:, 0] - 2) ** 2 * np.sin(12 * x[:, 0] - 4)


def forrester_low(x: np.ndarray) -> np.ndarray:
    return 0.5 * forrester(x) + 10 * (x[:, 0] - 0.5) - 5


def currin(x: np.ndarray) -> np.ndarray:
    """Xiong, Qian & Wu 2013."""
    a, b = x[:, 0], np.maximum(x[:, 1], 1e-8)
    top = 2300 * a**3 + 1900 * a**2 + 2092 * a + 60
    bottom = 100 * a**3 + 500 * a**2 + 4 * a + 20
    return (1 - np.exp(-0.5 / b)) * top / bottom


def currin_low(x: np.ndarray) -> np.ndarray:
    shifts = [(0.05, 0.05), (0.05, -0.05), (-0.05, 0.05), (-0.05, -0.05)]
    moved = [np.column_stack([x[:, 0] + a, np.maximum(x[:, 1] + b, 0)]) for a, b in shifts]
    return np.mean([currin(m) for m in moved], axis=0)


PROBLEMS = {"forrester": (1, forrester, forrester_low), "currin": (2, currin, currin_low)}


def scaled(d: Design) -> Design:
    """Both levels in the cheap one's unit."""
    units = Normalisation.of(d.y_low)
    low, high, test = ((y - units.centre) / units.scale for y in (d.y_low, d.y_high, d.y_test))
    return Design(d.x_low, low, d.x_high, high, d.x_test, test)


def own_nargp(d: Design, theta_low=None, theta_high=None) -> tuple[NARGP, float]:
    """The model and its levels' log-likelihoods' sum; at given hyperparameters, or its own."""
    same = Normalisation(0.0, 1.0)
    cheap, measured = Samples.of(d.x_low, d.y_low), Samples.of(d.x_high, d.y_high)
    if theta_low is None or theta_high is None:
        # Its noise is held, as in emukit, whose intermediate levels have a variance of 1e-4.
        low = fit_likelihood(cheap, "rbf", NOISE, starts=LOW_STARTS)
        model = fit_nargp(measured, low, same, noise=NOISE, units=same, starts=STARTS)
    else:
        low = at_hyperparameters(cheap, "rbf", theta_low, same)
        below = np.column_stack([d.x_high, low.predict(d.x_high)[0]])
        wide = Samples.of(below, d.y_high)
        kernel = perdikaris(d.x_high.shape[1])
        model = NARGP(low, at_hyperparameters(wide, kernel, theta_high, same), same)
    return model, low.log_likelihood + model.high.log_likelihood


def ask(designs: dict[str, Design], folder: Path, name: str):
    """What the public implementations say, from `folder` where they have said it already."""
    answers = folder / f"published{name}.npz"
    if not answers.exists():
        jobs, fresh = folder / f"jobs{name}.npz", folder / f"new{name}.npz"
        np.savez(jobs, **{f"{k}/{p}": v for k, d in designs.items() for p, v in vars(d).items()})
        script = Path(__file__).parents[1] / "support" / "published_peers.py"
        environment = {**os.environ, "PYTHONPATH": "", "OMP_NUM_THREADS": "1"}
        subprocess.run([PYTHON, script, jobs, fresh], check=True, env=environment)
        fresh.rename(answers)
    return np.load(answers)


def rmse(mean: np.ndarray, d: Design) -> float:
    """Over the output's sd."""
    return float(np.sqrt(np.mean((mean - d.y_test) ** 2)) / d.y_test.std())


def test_nargp_is_as_good_as_emukits(tmp_path):
    folder = Path(os.environ.get("FUSION_ANSWERS") or tmp_path)
    rows: dict[str, list] = {}
    for seed in range(SEEDS):
        designs = {f"{p}/{seed}": scaled(design(p, EXPENSIVE, seed)) for p in PROBLEMS}
        told = ask(designs, folder, f"nargp{seed}")
        for key, d in designs.items():
            model, value = own_nargp(d)
            same, same_value = own_nargp(d, told[f"{key}/theta_low"], told[f"{key}/theta_high"])
            rows.setdefault(key.split("/")[0], []).append(
                (
                    rmse(told[f"{key}/mean"], d),
                    rmse(same.predict(d.x_test)[0], d),
                    rmse(model.predict(d.x_test)[0], d),
                    same_value - told[f"{key}/log_likelihood"].sum(),
                    value - same_value,
                )
            )
    print(f"\n{EXPENSIVE} expensive points, medians of {SEEDS} designs; RMSE over the output's sd")
    for name, each in rows.items():
        peer, same, own, differs, gain = np.transpose(each)
        print(
            f"{name:14s} emukit {np.median(peer):.5f}  at its hyperparameters {np.median(same):.5f}"
            f" (largest difference {100 * np.max(np.abs(same / peer - 1)):.2f} %)"
            f"  own {np.median(own):.5f}  likelihoods differ by {np.abs(differs).max():.4f}, own "
            f"climb gains {np.array2string(np.round(gain, 1))}, RMSE off by "
            f"{np.array2string(np.round(100 * (own / peer - 1), 2))} %"
        )
    for name, each in rows.items():
        peer, same, own, differs, gain = np.transpose(each)
        assert np.all(np.abs(differs) < LIKELIHOODS), name
        assert np.median(np.abs(same / peer - 1)) < 0.01, name
        assert np.all(np.abs(same / peer - 1) < DRAWN), name
        assert np.all(gain > -SAME_PEAK), name
        assert abs(np.median(own / peer - 1)) < 0.01, name
        assert np.median(np.abs(own / peer - 1)[np.abs(gain) < SAME_PEAK]) < 0.01, name
