"""Ours beside emukit, SMT and BoTorch on the same data: coverage, NLPD, error and time.

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
from scipy.stats import norm

import fusion_peers
from fusion_problems import PROBLEMS, Design, design
from planner.fusion.fused import fit_fused, fit_low
from planner.fusion.levels import Samples
from planner.fusion.recursive import fit_recursive

COUNTS = (3, 5, 8, 11, 15)
SEEDS = int(os.environ.get("FUSION_SEEDS", "20"))
PYTHON = os.environ.get("PEERS_PYTHON", sys.executable)
PEERS = tuple(fusion_peers.PEERS)
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


def ours(d: Design):
    """Mean, sd, seconds: the cheap level is fitted too, and the values are known to be exact."""
    start = time.perf_counter()
    low = fit_low(Samples.of(d.x_low, d.y_low))
    model = fit_fused(Samples.of(d.x_high, d.y_high), low, float(np.std(d.y_low)), 1e-5)
    return *model.predict(d.x_test), time.perf_counter() - start


def score(d: Design, mean, sd, seconds):
    """Share inside the 95 % interval, NLPD and RMSE of y scaled to sd 1, seconds."""
    off, sd = (mean - d.y_test) / d.y_test.std(), np.maximum(sd / d.y_test.std(), SD_FLOOR)
    inside = np.mean(np.abs(off) < 1.96 * sd)
    return inside, -np.mean(norm.logpdf(off, scale=sd)), np.sqrt(np.mean(off**2)), float(seconds)


@pytest.fixture(scope="module")
def scores(tmp_path_factory):
    """{(problem, n, method): (seeds, 4)}."""
    folder = Path(os.environ.get("FUSION_ANSWERS", tmp_path_factory.mktemp("answers")))
    out: dict[tuple[str, int, str], list] = {}
    ours(design(PROBLEMS["forrester"], 3, 99))
    for seed in range(SEEDS):
        designs = {
            f"{p}/{n}/{seed}": design(problem, n, seed)
            for p, problem in PROBLEMS.items()
            for n in COUNTS
        }
        answers = ask_peers(designs, folder, str(seed))
        for key, d in designs.items():
            p, n, _ = key.split("/")
            out.setdefault((p, int(n), "ours"), []).append(score(d, *ours(d)))
            for peer in PEERS:
                if f"{key}/{peer}/mean" in answers:
                    values = (answers[f"{key}/{peer}/{what}"] for what in ("mean", "sd", "seconds"))
                    out.setdefault((p, int(n), peer), []).append(score(d, *values))
    return {key: np.array(rows) for key, rows in out.items()}


def test_calibration_and_error_beside_the_peers(scores):
    methods = ("ours", *PEERS)
    print(f"\n{SEEDS} designs a cell; coverage %, mean NLPD, median RMSE / sd of the output")
    print(" " * 14 + "".join(f"{m:>24s}" for m in methods))
    for p in PROBLEMS:
        for n in COUNTS:
            cells = [scores[p, n, m] for m in methods]
            text = "".join(
                f"{100 * c[:, 0].mean():7.0f} {c[:, 1].mean():8.2f} {np.median(c[:, 2]):7.4f}"
                for c in cells
            )
            print(f"{p:10s} {n:3d}{text}")
    overall = {}
    for m in methods:
        rows = np.concatenate([scores[p, n, m] for p in PROBLEMS for n in COUNTS])
        nlpd = {(p, n): scores[p, n, m][:, 1].mean() for p in PROBLEMS for n in COUNTS}
        overall[m] = (rows, nlpd)
        good = np.mean(rows[:, 2] < np.sqrt(0.1))
        print(
            f"{m:13s} coverage {100 * rows[:, 0].mean():5.1f} %  NLPD median "
            f"{np.median(rows[:, 1]):6.2f} mean {rows[:, 1].mean():9.2f}  median RMSE "
            f"{np.median(rows[:, 2]):.4f}  R² ≥ 0.9: {100 * good:.0f} %  {rows[:, 3].mean():.2f} s"
        )
    own, own_nlpd = overall["ours"]
    for peer in PEERS:
        wins = np.mean([own_nlpd[c] < overall[peer][1][c] for c in own_nlpd])
        print(f"NLPD below {peer} in {100 * wins:.0f} % of the cells")
        assert wins >= 0.75
    every = np.mean([v < min(overall[p][1][c] for p in PEERS) for c, v in own_nlpd.items()])
    print(f"NLPD below all of them at once in {100 * every:.0f} % of the cells")
    assert 0.90 <= own[:, 0].mean() <= 0.97
    assert np.median(own[:, 2]) <= min(np.median(overall[p][0][:, 2]) for p in PEERS)


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
    assert peers["emukit AR1"] > 30 * seconds["AR1, low level kept"]
