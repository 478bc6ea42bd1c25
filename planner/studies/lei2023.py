"""The study of Lei et al. 2023: the modal parameters of 112 postures, together and one by one.

Parameters come from hits (`lei2023_hits`): nine modes of 16 each, or as many as modal analysis
finds nearly everywhere. They are predicted one GP an output (the paper's STGP: RBF, of the greatest
likelihood), by kind (multi-task, B free), and all at once (`icm`), 5-fold as in the paper. Groups
by kind were chosen with robots 1 and 2.
"""

import time
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from planner.progress import Tell, within
from planner.studies import drawing
from planner.studies.lei2023_cost import cost_table
from planner.studies.lei2023_data import LEFT, RIGHT, parameters, postures, true_robot
from planner.studies.lei2023_hits import measured
from planner.studies.models.fidelity_levels import Samples
from planner.studies.models.icm import fit_icm
from planner.studies.models.likelihood_gp import fit_likelihood
from planner.studies.models.multitask import fit_multitask
from planner.studies.report import PaperClaim, Report, Table

ROBOTS = (11, 12, 13)
FOLDS = 5
FEW_FOLDS, EVERY = 2, 4  # of the small version: folds that are run, and every such posture
PAPER_S = 3.36  # for one group of three outputs
PARTS = 16
NEAREST = 4  # postures from which a missing value is filled in, to train with only
OF_KIND = {
    "frequency": (0,),
    "damping ratio": (1,),
    "L, real parts": range(LEFT.start, LEFT.stop, 2),
    "L, imaginary parts": range(LEFT.start + 1, LEFT.stop, 2),
    "R, real parts": range(RIGHT.start, RIGHT.stop, 2),
    "R, imaginary parts": range(RIGHT.start + 1, RIGHT.stop, 2),
}
WAYS = ("by kind", "all at once", "one by one")


@dataclass(frozen=True, eq=False)
class RobotScores:
    """R² (ways, folds, m) of one robot, what scatter of hits allows (m,), and seconds by way."""

    labels: np.ndarray
    r2: np.ndarray
    ceiling: np.ndarray
    seconds: dict[str, float]


def study(progress: Tell, small: bool = False) -> Report:
    """R² by 5-fold cross-validation on three robots, and the time that training takes."""
    robots = ROBOTS[:1] if small else ROBOTS
    scores = []
    for i, seed in enumerate(robots):
        part = within(progress, 0.95 * i / len(robots), 0.95 * (i + 1) / len(robots))
        scores.append(_scores(seed, small, part))
    progress("cost against m", 0.96)
    table, modes, cost = _by_kind(scores), _by_mode(scores), cost_table(small)
    return Report(
        "lei2023",
        f"SIMULATED: the KR240 with spindle in MuJoCo, robots: {len(robots)}, two points of the "
        "tool hit and heard along two axes at three levels with everyday errors; "
        f"{PARTS * len(scores[0].labels)} parameters of modes that modal analysis finds nearly "
        "everywhere.",
        (table, modes, cost),
        _findings(scores, cost),
        {"lei2023_kinds": _kinds_figure(table), "lei2023_modes": _modes_figure(modes)},
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
    filled = _filled(x, y)
    fold = np.random.default_rng(seed).permutation(len(x)) % FOLDS
    folds = range(FEW_FOLDS if small else FOLDS)
    r2 = np.empty((len(WAYS), len(folds), y.shape[1]))
    seconds: dict[str, float] = {}
    for j in folds:
        progress(f"robot {seed}, fold {j + 1} of {len(folds)}", 0.3 + 0.7 * j / len(folds))
        train, test = fold != j, fold == j
        for i, predict in enumerate((_by_kinds, _at_once, _alone)):
            start = time.process_time()
            predicted = predict(x[train], filled[train], x[test])
            seconds[WAYS[i]] = time.process_time() - start  # of the last fold: nothing compiles
            r2[i, j] = _r_squared(predicted, y[test])
    return RobotScores(labels, r2, 1 - error / size, seconds)


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


def _kinds(count: int) -> dict[str, np.ndarray]:
    """Columns of each kind among the parameters of so many modes."""
    number = np.arange(count * PARTS).reshape(count, PARTS)
    return {kind: number[:, list(parts)].ravel() for kind, parts in OF_KIND.items()}


def _by_kinds(x: np.ndarray, y: np.ndarray, there: np.ndarray) -> np.ndarray:
    predicted = np.empty((len(there), y.shape[1]))
    for kind in _kinds(y.shape[1] // PARTS).values():
        predicted[:, kind] = fit_multitask(x, y[:, kind]).predict(there)[0]
    return predicted


def _at_once(x: np.ndarray, y: np.ndarray, there: np.ndarray) -> np.ndarray:
    return fit_icm(x, y).predict(there)[0]


def _alone(x: np.ndarray, y: np.ndarray, there: np.ndarray) -> np.ndarray:
    models = (fit_likelihood(Samples.of(x, column), "rbf", starts=1) for column in y.T)
    return np.column_stack([model.predict(there)[0] for model in models])


def _findings(scores: list[RobotScores], cost: Table) -> tuple[PaperClaim, ...]:
    better, steadier = _shares(scores, "by kind")
    once, _ = _shares(scores, "all at once")
    seconds = max(s.seconds["by kind"] for s in scores)
    whole = max(s.seconds["all at once"] for s in scores)
    count = PARTS * len(scores[0].labels)
    rows = {int(float(row[0])): row for row in cost.rows}
    most = max(rows)
    return (
        PaperClaim(
            "Together parameters are predicted better than one by one (mean R²).",
            f"by kind in {100 * better:.0f} % of the parameters that scatter does not bury, all at "
            f"once in {100 * once:.0f} %",
            better > 0.9,
            f"median R² of those {_median(scores, 'by kind'):.2f} by kind, "
            f"{_median(scores, 'all at once'):.2f} all at once, "
            f"{_median(scores, 'one by one'):.2f} one by one",
        ),
        PaperClaim(
            "Together they are predicted more steadily (spread of R² over folds).",
            f"in {100 * steadier:.0f} % of them",
            steadier > 0.9,
            f"in {100 * (1 - steadier):.0f} % the folds differ as much",
        ),
        PaperClaim(
            "Training time soars where more than three parameters are trained together.",
            f"{most} at once: {float(rows[most][1]):.2f} s by Kronecker's structure, one direct "
            f"Cholesky factor of {min(9, most)}: {float(rows[min(9, most)][2]):.3f} s",
            bool(float(rows[most][1]) > 50 * PAPER_S),
            "every output is measured at every posture, so that two small eigendecompositions do "
            f"it: cost grows to {float(rows[most][1]):.1f} s only",
        ),
        PaperClaim(
            f"{count} parameters train in less time than the paper's group of three (3.36 s).",
            f"{seconds:.2f} s by kind, {whole:.2f} s all at once, of one processor",
            min(seconds, whole) < PAPER_S,
            "this machine is slower",
            ours=True,
        ),
    )


def _shares(scores: list[RobotScores], way: str) -> tuple[float, float]:
    """Shares of parameters that are better (mean) and steadier (spread) than one by one.

    Of those that vary by more than their scatter.
    """
    better, steadier = [], []
    for each in scores:
        heard = each.ceiling > 0.5
        one, other = each.r2[WAYS.index(way)], each.r2[WAYS.index("one by one")]
        better.append((one.mean(axis=0) > other.mean(axis=0))[heard])
        steadier.append((one.std(axis=0) < other.std(axis=0))[heard])
    return float(np.concatenate(better).mean()), float(np.concatenate(steadier).mean())


def _median(scores: list[RobotScores], way: str) -> float:
    """Median R² of the parameters that vary by more than their scatter."""
    each = [s.r2[WAYS.index(way)].mean(axis=0)[s.ceiling > 0.5] for s in scores]
    return float(np.median(np.concatenate(each)))


def _middle(scores: list[RobotScores], which: str | int) -> list[float]:
    """Medians over some outputs of each way's mean and spread over folds; and the ceiling.

    `which`: a kind, or the frequency of a mode (from 0).
    """
    columns = [
        _kinds(len(s.labels))[which] if isinstance(which, str)
        else PARTS * np.flatnonzero(s.labels == which)
        for s in scores
    ]  # fmt: skip
    values = []
    for i in range(len(WAYS)):
        parts = [s.r2[i][:, c] for s, c in zip(scores, columns, strict=True)]
        values.append(np.median(np.concatenate([p.mean(axis=0) for p in parts])))
        values.append(np.median(np.concatenate([p.std(axis=0) for p in parts])))
    ceiling = np.concatenate([s.ceiling[c] for s, c in zip(scores, columns, strict=True)])
    return [float(v) for v in (*values, np.median(ceiling))]


COLUMNS = (*(f"{way}: {what}" for way in WAYS for what in ("mean", "spread")), "scatter allows")


def _by_kind(scores: list[RobotScores]) -> Table:
    rows = [(kind, *_middle(scores, kind)) for kind in OF_KIND]
    return Table(
        "lei2023_kinds", "R² over folds by kind of parameter: medians over modes and robots",
        ("outputs", *COLUMNS), tuple(rows),
    )  # fmt: skip


def _by_mode(scores: list[RobotScores]) -> Table:
    labels = sorted(set.intersection(*(set(s.labels.tolist()) for s in scores)))
    rows = [(f"mode {k + 1}", *_middle(scores, k)) for k in labels]
    return Table(
        "lei2023_frequencies", "R² over folds of natural frequencies: medians over robots",
        ("mode", *COLUMNS), tuple(rows),
    )  # fmt: skip


def _kinds_figure(table: Table) -> Figure:
    return _figure(table, "Modal parameters of all postures, by cross-validation", -0.5)


def _modes_figure(table: Table) -> Figure:
    return _figure(table, "Natural frequencies, by cross-validation", 0.0)


def _figure(table: Table, title: str, floor: float) -> Figure:
    figure = drawing.new((10.0, 6.4), title)
    panels = figure.subplots(2, 1, sharex=True)
    values = np.array([row[1:] for row in table.rows], dtype=float)
    groups = [str(row[0]) for row in table.rows]
    mean = values[:, [6, 4, 0, 2]]
    drawing.bars(panels[0], groups, ("scatter allows", "one by one", *WAYS[:2]), mean,
                 "R², mean over folds", floor)  # fmt: skip
    spread = values[:, [5, 1, 3]]
    drawing.bars(panels[1], groups, ("one by one", *WAYS[:2]), spread, "R², spread over folds")
    drawing.legend(figure, panels[0])
    return figure
