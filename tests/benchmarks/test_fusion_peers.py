"""Ours beside emukit, SMT and BoTorch on the same data: coverage, NLPD, error and time.

Every prediction is scored as what it is: the peers' are Gaussians, ours is a mixture of Gaussians.
What its mean and sd alone would score is told too. `development_problems` is what ours was
developed on.

`pytest -m slow -s tests/benchmarks/test_fusion_peers.py` prints the tables. The peers (extra
`peers`) run in the interpreter that PEERS_PYTHON names, else in this one. FUSION_SEEDS (20) says
how many designs per cell, FUSION_ANSWERS a folder that keeps the peers' answers between runs.
"""

import importlib.util
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from planner.surrogate.models.averaged import fit_recursive
from planner.surrogate.models.fidelity_levels import Samples
from planner.surrogate.predictive import Predictive
from tests.support import fusion_peers
from tests.support.fused import fit_fused, fit_low
from tests.support.fusion_problems import PROBLEMS, Design, design
from tests.support.mixture import log_density
from tests.support.robot_problems import ROBOT_PROBLEMS

COUNTS = (3, 5, 8, 11, 15)
SEEDS = int(os.environ.get("FUSION_SEEDS", "20"))
PYTHON = os.environ.get("PEERS_PYTHON", sys.executable)
PEERS = tuple(fusion_peers.PEERS)
MOMENTS = "ours as Gaussian"
EXACT = 1e-6  # noise of computed values, over their scale
SD_FLOOR = 1e-6  # of the test values' sd: below it all of these functions are rounding errors

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(0),
    pytest.mark.skipif(
        "PEERS_PYTHON" not in os.environ and importlib.util.find_spec("emukit") is None,
        reason="the peers are not installed: pip install 'planner[peers]', or set PEERS_PYTHON",
    ),
]


def ask_peers(designs: dict[str, Design], folder: Path, name: str, peers=PEERS):
    """Their answers for these designs, from `folder` where they are already."""
    answers = folder / f"ans{name}.npz"
    if not answers.exists():
        jobs, fresh = folder / f"jobs{name}.npz", folder / f"new{name}.npz"
        parts = {f"{k}/{p}": v for k, d in designs.items() for p, v in vars(d).items()}
        np.savez(jobs, **parts)
        script = Path(fusion_peers.__file__)
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": ""}
        subprocess.run([PYTHON, str(script), jobs, fresh, *peers], check=True, env=environment)
        fresh.rename(answers)
    return np.load(answers)


def ours(d: Design) -> tuple[Predictive, float]:
    """Prediction and seconds: the cheap level is fitted too, and the values are known as exact."""
    start = time.perf_counter()
    low = fit_low(Samples.of(d.x_low, d.y_low))
    model = fit_fused(Samples.of(d.x_high, d.y_high), low, float(np.std(d.y_low)), EXACT)
    return model.predictive(d.x_test), time.perf_counter() - start


def gaussian(mean, sd) -> Predictive:
    """Of a mean and an sd (q,)."""
    return Predictive(np.ones(1), mean[None], sd[None])


def score(d: Design, found: Predictive, seconds):
    """Share inside the 95 % interval, NLPD and RMSE of y scaled to sd 1, seconds."""
    least, size = SD_FLOOR * d.y_test.std(), d.y_test.std()
    found = Predictive(found.weights, found.means, np.maximum(found.sds, least))
    inside = np.mean(np.abs(found.below(d.y_test) - 0.5) < 0.475)
    nlpd = -np.mean(log_density(found, d.y_test)) - np.log(size)
    return inside, nlpd, np.sqrt(np.mean((found.median - d.y_test) ** 2)) / size, float(seconds)


def run(problems, name, seeds, folder):
    """{(problem, n, method): (seeds, 4)}."""
    out: dict[tuple[str, int, str], list] = {}
    ours(design(PROBLEMS["forrester"], 3, 99))
    for seed in range(seeds):
        designs = {
            f"{p}/{n}/{seed}": design(problem, n, seed)
            for p, problem in problems.items()
            for n in COUNTS
        }
        answers = ask_peers(designs, folder, f"{name}{seed}")
        for key, d in designs.items():
            p, n, _ = key.split("/")
            found, seconds = ours(d)
            out.setdefault((p, int(n), "ours"), []).append(score(d, found, seconds))
            rough = gaussian(found.mean, found.sd)
            out.setdefault((p, int(n), MOMENTS), []).append(score(d, rough, seconds))
            for peer in PEERS:
                if f"{key}/{peer}/mean" in answers:
                    mean, sd, took = (
                        answers[f"{key}/{peer}/{what}"] for what in ("mean", "sd", "seconds")
                    )
                    out.setdefault((p, int(n), peer), []).append(score(d, gaussian(mean, sd), took))
    return {key: np.array(rows) for key, rows in out.items()}


@pytest.fixture
def folder(tmp_path):
    return Path(os.environ.get("FUSION_ANSWERS", tmp_path))


def told(scores, problems):
    """Prints the table; by method median RMSE, NLPDs of the cells, coverage, share of R² ≥ 0.9."""
    methods = ("ours", MOMENTS, *PEERS)
    print("\ncoverage %, mean NLPD, median RMSE / sd of the output")
    print(" " * 18 + "".join(f"{m:>24s}" for m in methods))
    cells = [(p, n) for p in problems for n in COUNTS]
    for p, n in cells:
        rows = [scores[p, n, m] for m in methods]
        text = "".join(
            f"{100 * c[:, 0].mean():7.0f} {c[:, 1].mean():8.2f} {np.median(c[:, 2]):7.4f}"
            for c in rows
        )
        print(f"{p:14s} {n:3d}{text}")
    out = {}
    for m in methods:
        rows = np.concatenate([scores[(*cell, m)] for cell in cells])
        nlpd = np.array([scores[(*cell, m)][:, 1].mean() for cell in cells])
        good = np.mean(rows[:, 2] < np.sqrt(0.1))
        out[m] = np.median(rows[:, 2]), nlpd, rows[:, 0].mean(), good
        print(
            f"{m:13s} coverage {100 * out[m][2]:5.1f} %  NLPD median {np.median(rows[:, 1]):6.2f} "
            f"mean {rows[:, 1].mean():9.2f}  median RMSE {out[m][0]:.4f}  "
            f"R² ≥ 0.9: {100 * good:.0f} %  {rows[:, 3].mean():.2f} s"
        )
    for m in ("ours", MOMENTS):
        own = out[m][1]
        for peer in PEERS:
            print(f"NLPD of {m} below {peer} in {100 * np.mean(own < out[peer][1]):.0f} % of cells")
        least = np.min([out[p][1] for p in PEERS], axis=0)
        print(f"NLPD of {m} below all of them at once in {100 * np.mean(own < least):.0f} %")
        lost = [f"{p} {n}" for (p, n), worse in zip(cells, own >= least, strict=True) if worse]
        print("lost to one of them: " + ", ".join(lost))
    return out


def test_calibration_and_error_beside_the_peers(folder):
    robots = {name: make() for name, make in ROBOT_PROBLEMS.items()}
    functions = run(PROBLEMS, "", SEEDS, folder)
    frequencies = run(robots, "robots", SEEDS, folder)
    print("\nFunctions:")
    told(functions, PROBLEMS)
    print("\nFrequencies of robots:")
    told(frequencies, robots)
    print("\nAll of them:")
    out = told(functions | frequencies, PROBLEMS | robots)
    rmse, nlpd, coverage, good = out["ours"]
    assert 0.90 <= coverage <= 0.97
    assert rmse <= min(out[p][0] for p in PEERS)
    assert good >= max(out[p][3] for p in PEERS)
    assert min(np.mean(nlpd < out[p][1]) for p in PEERS) >= 0.8


def test_times_of_a_refit_with_500_simulated_and_30_measured_points(tmp_path):
    rng = np.random.default_rng(0)
    problem = PROBLEMS["pose"]
    x = rng.random((500, 2))
    test = rng.random((200, 2))
    d = Design(x, problem.low(x), x[:30], problem.high(x[:30]), test, problem.high(test))
    seconds = {}
    for _ in range(2):  # the first compiles
        start = time.perf_counter()
        low = fit_low(Samples.of(d.x_low, d.y_low))
        middle = time.perf_counter()
        model = fit_recursive(Samples.of(d.x_high, d.y_high), low, float(np.std(d.y_low)))
        seconds["AR1, low level kept"] = time.perf_counter() - middle
        seconds["AR1, everything"] = time.perf_counter() - start
        middle = time.perf_counter()
        fit_fused(Samples.of(d.x_high, d.y_high), low, float(np.std(d.y_low)))
        seconds["mixture, low level kept"] = time.perf_counter() - middle
    error = np.std(model.predict(test)[0] - d.y_test) / np.std(d.y_test)
    print(f"\nAR1's error {error:.4f} of the output's sd")
    answers = ask_peers({"pose/30/0": d}, tmp_path, "speed", ("emukit AR1", "SMT MFK"))
    peers = {p: float(answers[f"pose/30/0/{p}/seconds"]) for p in ("emukit AR1", "SMT MFK")}
    for name, s in (seconds | peers).items():
        ratios = "".join(f"  {p} / this {t / s:7.1f}" for p, t in peers.items())
        print(f"{name:24s} {s:8.3f} s{ratios}")
    assert peers["emukit AR1"] > 100 * seconds["AR1, low level kept"]
    assert peers["SMT MFK"] > 3 * seconds["AR1, everything"]
