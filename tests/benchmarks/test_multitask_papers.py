"""Lei 2023 and Seyed Hosseini 2025: many modal parameters over joint space, fitted jointly or not.

`pytest -m slow -s tests/benchmarks/test_multitask_papers.py` prints the tables. Recordings of
either are not public: postures of a KR210-like robot as MuJoCo has it, with EMA's scatter.
"""

import time

import numpy as np
import pytest

from planner.surrogate.models.averaged import fit_gp
from planner.surrogate.models.likelihood_gp import Samples
from planner.surrogate.models.multitask import fit_multitask
from planner.truth.arms import ARMS
from planner.truth.deviation import Deviation
from planner.truth.load import load_truth

MODES, TASKS, POSTURES, FOLDS = 9, 11, 112, 5
PART = 0.4  # of every joint's range: postures that one would mill in
SCATTER = {"frequency": 0.002, "damping": 0.05, "residue": 0.05}

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1500)]


def truth_of(folder):
    return load_truth(ARMS["kr210"].write(folder, 3), Deviation(5, 0.15, 0.1, 0.05))


def postures(count, seed=0):
    """Joint angles (n, 6) in rad of a Latin hypercube over the workspace, and scaled to [0, 1]."""
    from scipy.stats import qmc

    box = np.deg2rad(ARMS["kr210"].joints_deg)
    x = qmc.LatinHypercube(6, rng=np.random.default_rng(seed)).random(count)
    return box.mean(axis=1) + PART * (x - 0.5) * np.ptp(box, axis=1), x


def parameters(truth, q, seed=1):
    """Of every mode 11 parameters (n, 9, 11): log f, log ζ, imaginary parts of nine residues.

    The real parts are next to nothing at this proportional damping.
    """
    rng = np.random.default_rng(seed)
    rows = []
    for posture in q:
        f, zeta, residue = truth.modes(posture, MODES)
        parts = residue.imag.reshape(MODES, 9)
        rows.append(np.column_stack([np.log(f), np.log(zeta), parts]))
    clean = np.array(rows)
    size = np.sqrt(np.mean(clean[:, :, 2:] ** 2, axis=(0, 2)))[None, :, None]
    noisy = clean + 0.0
    noisy[:, :, 0] += SCATTER["frequency"] * rng.standard_normal(clean.shape[:2])
    noisy[:, :, 1] += SCATTER["damping"] * rng.standard_normal(clean.shape[:2])
    noisy[:, :, 2:] += SCATTER["residue"] * size * rng.standard_normal(clean[:, :, 2:].shape)
    return noisy


def r2(told, measured):
    """Per output (t,)."""
    return 1 - np.mean((told - measured) ** 2, axis=0) / np.var(measured, axis=0)


def test_lei2023_together_and_one_by_one(tmp_path):
    q, x = postures(POSTURES)
    y = parameters(truth_of(tmp_path), q)
    fold = np.random.default_rng(2).permutation(POSTURES) % FOLDS
    together, alone = np.empty((2, FOLDS, MODES, TASKS))
    fit_multitask(x[fold != 0], y[fold != 0, 0])  # compiles
    spent = []
    for i in range(FOLDS):
        train, test = fold != i, fold == i
        start = time.process_time()
        models = [fit_multitask(x[train], y[train, k]) for k in range(MODES)]
        spent.append(time.process_time() - start)
        for k, model in enumerate(models):
            together[i, k] = r2(model.predict(x[test])[0], y[test, k])
            for t in range(TASKS):
                gp = fit_gp(Samples.of(x[train], y[train, k, t]), "rbf")
                alone[i, k, t] = r2(gp.predict(x[test])[0], y[test, k, t])
    print("\nR² by 5-fold cross-validation, mean over the parameters of a mode")
    print("mode   together (spread over folds)   one by one     frequency together / one by one")
    for k in range(MODES):
        folds = together[:, k].mean(axis=1)
        print(
            f"{k + 1:4d}{folds.mean():11.3f} ({folds.std():.3f}) {alone[:, k].mean():19.3f}"
            f"{together[:, k, 0].mean():19.3f} / {alone[:, k, 0].mean():.3f}"
        )
    print(f"99 outputs train in {np.median(spent):.2f} s of processor (paper: 3.36 s for three)")
    assert np.median(spent) < 3.36
    assert together.mean() > alone.mean()


def test_seyedhosseini2025_last_fifteen_of_254_postures(tmp_path):
    """A trajectory through joint space, its end told from its beginning."""
    t = np.linspace(0, 1, 254)
    turns = np.array([1.0, 1.7, 2.3, 0.7, 1.3, 2.9])
    x = 0.5 + 0.45 * np.sin(2 * np.pi * (t[:, None] * turns + np.arange(6) / 6))
    box = np.deg2rad(ARMS["kr210"].joints_deg)
    q = box[:, 0] + x * np.ptp(box, axis=1)
    y = parameters(truth_of(tmp_path), q)
    start = time.perf_counter()
    model = fit_multitask(x[:-15], y[:-15, :4, 0])
    spent = time.perf_counter() - start
    mean, sd = model.predict(x[-15:])
    off = 100 * np.abs(np.exp(mean - y[-15:, :4, 0]) - 1)
    spread = np.hypot(sd, SCATTER["frequency"])
    inside = np.mean(np.abs(mean - y[-15:, :4, 0]) < 1.96 * spread)
    error = np.round(off.mean(axis=0), 2)
    print(f"\nfrequencies of the last 15 postures, modes 1 to 4: error {error} %")
    print(f"inside the 95 % interval {100 * inside:.0f} %; fitted in {spent:.2f} s")
    print("correlation of joints 1 to 6 with the frequencies of modes 1 to 4:")
    joint = np.corrcoef(np.column_stack([q, y[:, :4, 0]]).T)[:6, 6:]
    for j, row in enumerate(joint, 1):
        print(f"joint {j}" + "".join(f"{v:8.2f}" for v in row))
    assert off.mean() < 2.0
    assert inside > 0.75
