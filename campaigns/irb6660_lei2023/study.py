"""The study of Lei et al. 2023: the modal parameters of 112 postures, together and one by one.

Parameters come from hits (`data`): nine modes of 16 each, or as many as modal analysis finds nearly
everywhere. They are predicted 5-fold as in the paper: one by one (its STGP) and in its groups of
three at most (its MTGP, `scores`), both as published. Ours beside them: by kind (B free, chosen
with robots 1 and 2) and all at once (of a low rank). The paper's coupling of another tool and its
stability lobes are in NOTES.md, by `planner couple` and `planner stability`.
"""

import time

import numpy as np

from planner.progress import ProgressCallback, part_of
from planner.studies.claims import Bound, ClaimRule, in_order
from planner.studies.report import Paper, Report, Table, on_each, r_squared
from planner.surrogate.models.likelihood_gp import Samples, fit_likelihood
from planner.surrogate.models.multitask import RANK, fit_multitask

from . import scores
from .data import measured, parameters, postures, true_robot
from .scores import ALONE, AT_ONCE, BY_KIND, GROUPS, KNOWN, PARTS, WAYS, RobotScores

PAPER = Paper(
    "Lei, Hou, Ding", 2023,
    "Prediction of the Posture-Dependent Tool Tip Dynamics in Robotic Milling Based on "
    "Multi-Task Gaussian Process Regressions",
    "Robotics and Computer-Integrated Manufacturing 81",
)  # fmt: skip
ROBOTS = (11, 12, 13)
FOLDS = 5
FEW_FOLDS, EVERY = 2, 6  # of the small version: folds that are run, and every such posture
NEAREST = 4  # postures from which a missing value is filled in, to train with only
RULES = (
    ClaimRule(
        "In groups of three, parameters are predicted better than one by one (mean R²).",
        Bound("better in groups, % of parameters", above=50, paper=100),
        Bound("median R² gained in groups", above=0, full=0.01),
    ),
    ClaimRule(
        "The same, read so that the group's other parameters are known at tested postures.",
        Bound("better with the others known, % of parameters", above=50, paper=100),
        Bound("steadier with the others known, % of parameters", above=50, paper=100),
        Bound("median R² gained with the others known", above=0, full=0.01),
    ),
    ClaimRule(
        "In groups they are predicted more steadily (spread of R² over folds).",
        Bound("steadier in groups, % of parameters", above=50, paper=100),
    ),
    ClaimRule(
        "Larger groups than the paper's predict better than one by one.",
        Bound("better by kind, % of parameters", above=50),
        Bound("better all at once, % of parameters", above=50),
        ours=True,
    ),
    ClaimRule(
        "Groups halve the number of models.",
        Bound("models per parameter", below=0.6, paper=0.486),
    ),
    ClaimRule(
        "Frequencies are predicted better than damping ratios, all within 10 %.",
        Bound("damping ratios' mean error over frequencies'", above=1, full=2),
        Bound("largest error of a frequency, %", below=10, paper="under 10 % at three postures"),
        Bound("largest error of a damping ratio, %", below=10, paper="under 10 %"),
    ),
    ClaimRule(
        "Training time soars where more than three parameters are trained together.",
        Bound("time of all together over that of three", above=10, paper=26.4),
    ),
    ClaimRule(
        "All parameters train in less time than the paper's group of three.",
        Bound("time of the quicker of by kind and all at once, s", below=scores.PAPER_S[3]),
        ours=True,
    ),
    ClaimRule(
        "Cuts with another tool are stable where the coupled FRFs' lobes say so.",
        Bound("cuts that the lobes tell rightly, %", above=50, full=90, paper="Fig. 29"),
    ),
)  # fmt: skip


def study(progress: ProgressCallback, small: bool = False) -> Report:
    """R² by 5-fold cross-validation on several robots, and the time that training takes."""
    robots = ROBOTS[:1] if small else ROBOTS
    part = part_of(progress, 0.0, 0.95)
    scored = on_each(robots, lambda seed, progress: _scores(seed, small, progress), part)
    progress("cost against m", 0.96)
    table, modes, cost = scores.by_kind(scored), scores.by_mode(scored), scores.cost_table(small)
    return Report(
        f"SIMULATED: the KR240 with spindle in MuJoCo, robots: {len(robots)}, two points of the "
        "tool hit and heard along two axes at three levels with everyday errors; "
        f"{PARTS * len(scored[0].labels)} parameters of modes that modal analysis finds nearly "
        "everywhere. The paper's target tool and its stability lobes are not done again here.",
        (table, modes, cost),
        [figures(one, cost) for one in scored],
        _notes(scored, cost),
        {
            "lei2023_kinds": scores.figure(table, "Modal parameters of all postures", -0.5),
            "lei2023_modes": scores.figure(modes, "Natural frequencies", 0.0),
        },
    )


def figures(one: RobotScores, cost: Table) -> dict[str, float]:
    """What RULES stand on, of one robot; nothing is cut here."""
    known, grouped, kind, whole = (
        100 * np.array(scores.shares([one], way)) for way in (KNOWN, GROUPS, BY_KIND, AT_ONCE)
    )
    alone = scores.median([one], ALONE)
    trained = {int(float(row[0])): float(row[1]) for row in cost.rows}
    f, zeta = one.off["frequency"], one.off["damping ratio"]
    values = (
        grouped[0],
        scores.median([one], GROUPS) - alone,
        *known,
        scores.median([one], KNOWN) - alone,
        grouped[1],
        kind[0],
        whole[0],
        one.models / (PARTS * len(one.labels)),
        np.nanmean(zeta) / np.nanmean(f),
        np.nanmax(f),
        np.nanmax(zeta),
        trained[max(trained)] / max(trained[3], 1e-9),
        min(one.seconds[BY_KIND], one.seconds[AT_ONCE]),
        np.nan,
    )
    return in_order(RULES, values)


def _notes(scored: list[RobotScores], cost: Table) -> dict[str, str]:
    direct = {int(float(row[0])): float(row[2]) for row in cost.rows}
    off = np.concatenate([s.off["damping ratio"].ravel() for s in scored])
    many = direct[scores.MOST_DIRECT] / max(direct[3], 1e-9)
    return {
        "better in groups, % of parameters": f"R² differ by {scores.apart(scored, GROUPS):.3f} in "
        "the median: of parameters measured at the same postures with little noise, one task tells "
        "the others nothing (Bonilla et al. 2008), and all share one set of length scales",
        "largest error of a damping ratio, %": f"{100 * np.nanmean(off > 10):.0f} % of the damping "
        "ratios are off by more than 10 %; the paper looks at three postures",
        "time of all together over that of three": "every parameter is measured at every posture, "
        "so that two small eigendecompositions do what one large Cholesky factor did (that of "
        f"{scores.MOST_DIRECT} costs {many:.0f} times that of three)",
        "cuts that the lobes tell rightly, %": "nothing is cut here; NOTES.md has the paper's four "
        "cuts beside the lobes",
    }


def _scores(seed: int, small: bool, progress: ProgressCallback) -> RobotScores:
    truth = true_robot(seed)
    q, x = postures(truth)
    q, x = (q[::EVERY], x[::EVERY]) if small else (q, x)
    told = measured(truth, q, x, seed, part_of(progress, 0.0, 0.3))
    labels = told.often
    y = told.values[:, labels].reshape(len(q), -1)
    clean = parameters(truth, q, told.reference)[:, labels].reshape(len(q), -1)
    error, size = np.nanmean((y - clean) ** 2, axis=0), np.nanvar(y, axis=0)
    filled, together = _filled(x, y), scores.groups(labels, told.reference[labels])
    fold = np.random.default_rng(seed).permutation(len(x)) % FOLDS
    folds = range(FEW_FOLDS if small else FOLDS)
    r2 = np.empty((len(WAYS), len(folds), y.shape[1]))
    seconds: dict[str, float] = {}
    off = []
    for j in folds:
        progress(f"robot {seed}, fold {j + 1} of {len(folds)}", 0.3 + 0.7 * j / len(folds))
        predicted = _predicted(x, filled, fold != j, together, seconds)
        for i, way in enumerate(WAYS):
            r2[i, j] = r_squared(predicted[way], y[fold == j], 0)
        off.append(100 * np.abs(predicted[GROUPS] / y[fold == j] - 1))
    which = scores.kinds(len(labels))
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
    predicted[GROUPS], predicted[KNOWN] = scores.predict(x, y, train, together)
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


def _by_kinds(x: np.ndarray, y: np.ndarray, there: np.ndarray) -> np.ndarray:
    predicted = np.empty((len(there), y.shape[1]))
    for kind in scores.kinds(y.shape[1] // PARTS).values():
        predicted[:, kind] = fit_multitask(x, y[:, kind]).predict(there)[0]
    return predicted


def _at_once(x: np.ndarray, y: np.ndarray, there: np.ndarray) -> np.ndarray:
    return fit_multitask(x, y, rank=RANK).predict(there)[0]


def _alone(x: np.ndarray, y: np.ndarray, there: np.ndarray) -> np.ndarray:
    models = (fit_likelihood(Samples.of(x, column), "rbf", starts=1) for column in y.T)
    return np.column_stack([model.predict(there)[0] for model in models])
