"""The study of Lei et al. 2023: the modal parameters of 112 postures, together and one by one.

Parameters come from hits (`lei2023_hits`): nine modes of 16 each, or as many as modal analysis
finds nearly everywhere. They are predicted 5-fold as in the paper: one by one (its STGP) and in its
groups of three at most (its MTGP, `lei2023_groups`), both as published. Ours beside them: by kind
(B free, chosen with robots 1 and 2) and all at once (`icm`). The paper's coupling of another tool
and its stability lobes are no part of this study.
"""

import time

import numpy as np

from planner.progress import Tell, within
from planner.studies.lei2023_cost import cost_table
from planner.studies.lei2023_data import parameters, postures, true_robot
from planner.studies.lei2023_findings import findings
from planner.studies.lei2023_groups import PARTS, groups, predict
from planner.studies.lei2023_hits import measured
from planner.studies.lei2023_scores import (
    ALONE,
    AT_ONCE,
    BY_KIND,
    GROUPS,
    KNOWN,
    WAYS,
    RobotScores,
    by_kind,
    by_mode,
    kinds,
    kinds_figure,
    modes_figure,
)
from planner.studies.models.fidelity_levels import Samples
from planner.studies.models.icm import fit_icm
from planner.studies.models.likelihood_gp import fit_likelihood
from planner.studies.models.multitask import fit_multitask
from planner.studies.report import Report

ROBOTS = (11, 12)
FOLDS = 5
FEW_FOLDS, EVERY = 2, 4  # of the small version: folds that are run, and every such posture
NEAREST = 4  # postures from which a missing value is filled in, to train with only


def study(progress: Tell, small: bool = False) -> Report:
    """R² by 5-fold cross-validation on two robots, and the time that training takes."""
    robots = ROBOTS[:1] if small else ROBOTS
    scores = []
    for i, seed in enumerate(robots):
        part = within(progress, 0.95 * i / len(robots), 0.95 * (i + 1) / len(robots))
        scores.append(_scores(seed, small, part))
    progress("cost against m", 0.96)
    table, modes, cost = by_kind(scores), by_mode(scores), cost_table(small)
    return Report(
        "lei2023",
        f"SIMULATED: the KR240 with spindle in MuJoCo, robots: {len(robots)}, two points of the "
        "tool hit and heard along two axes at three levels with everyday errors; "
        f"{PARTS * len(scores[0].labels)} parameters of modes that modal analysis finds nearly "
        "everywhere. The paper's target tool and its stability lobes are not done again here.",
        (table, modes, cost),
        findings(scores, cost),
        {"lei2023_kinds": kinds_figure(table), "lei2023_modes": modes_figure(modes)},
    )


def _scores(seed: int, small: bool, progress: Tell) -> RobotScores:
    truth = true_robot(seed)
    q, x = postures(truth)
    q, x = (q[::EVERY], x[::EVERY]) if small else (q, x)
    told = measured(truth, q, x, seed, within(progress, 0.0, 0.3))
    labels = told.often
    y = told.values[:, labels].reshape(len(q), -1)
    clean = parameters(truth, q, told.reference)[:, labels].reshape(len(q), -1)
    error, size = np.nanmean((y - clean) ** 2, axis=0), np.nanvar(y, axis=0)
    filled, together = _filled(x, y), groups(labels, told.reference[labels])
    fold = np.random.default_rng(seed).permutation(len(x)) % FOLDS
    folds = range(FEW_FOLDS if small else FOLDS)
    r2 = np.empty((len(WAYS), len(folds), y.shape[1]))
    seconds: dict[str, float] = {}
    off = []
    for j in folds:
        progress(f"robot {seed}, fold {j + 1} of {len(folds)}", 0.3 + 0.7 * j / len(folds))
        predicted = _predicted(x, filled, fold != j, together, seconds)
        for i, way in enumerate(WAYS):
            r2[i, j] = _r_squared(predicted[way], y[fold == j])
        off.append(100 * np.abs(predicted[GROUPS] / y[fold == j] - 1))
    which = kinds(len(labels))
    errors = {kind: np.concatenate(off)[:, which[kind]] for kind in ("frequency", "damping ratio")}
    return RobotScores(labels, r2, 1 - error / size, seconds, len(together), errors)


def _predicted(
    x: np.ndarray, y: np.ndarray, train: np.ndarray, together: list[np.ndarray],
    seconds: dict[str, float],
) -> dict[str, np.ndarray]:  # fmt: skip
    """By each way at the postures not trained with; `seconds` of processor by way are put in.

    Those of the last fold stay, in which nothing is compiled any more.
    """
    predicted = {}
    for way, one in ((ALONE, _alone), (BY_KIND, _by_kinds), (AT_ONCE, _at_once)):
        start = time.process_time()
        predicted[way] = one(x[train], y[train], x[~train])
        seconds[way] = time.process_time() - start
    start = time.process_time()
    predicted[GROUPS], predicted[KNOWN] = predict(x, y, train, together)
    seconds[GROUPS] = time.process_time() - start
    return predicted


def _filled(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """y (n, m) with what is missing as the mean of the nearest postures that have it."""
    out = y.copy()
    for i, k in zip(*np.nonzero(~np.isfinite(y)), strict=True):
        known = np.flatnonzero(np.isfinite(y[:, k]))
        near = known[np.argsort(np.linalg.norm(x[known] - x[i], axis=1))[:NEAREST]]
        out[i, k] = y[near, k].mean()
    return out


def _r_squared(predicted: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """R² (m,) over the postures where a parameter was measured (eq. 31)."""
    return 1 - np.nanmean((predicted - measured) ** 2, axis=0) / np.nanvar(measured, axis=0)


def _by_kinds(x: np.ndarray, y: np.ndarray, there: np.ndarray) -> np.ndarray:
    predicted = np.empty((len(there), y.shape[1]))
    for kind in kinds(y.shape[1] // PARTS).values():
        predicted[:, kind] = fit_multitask(x, y[:, kind]).predict(there)[0]
    return predicted


def _at_once(x: np.ndarray, y: np.ndarray, there: np.ndarray) -> np.ndarray:
    return fit_icm(x, y).predict(there)[0]


def _alone(x: np.ndarray, y: np.ndarray, there: np.ndarray) -> np.ndarray:
    models = (fit_likelihood(Samples.of(x, column), "rbf", starts=1) for column in y.T)
    return np.column_stack([model.predict(there)[0] for model in models])
