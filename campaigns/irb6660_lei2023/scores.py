"""How Lei et al. 2023's parameters are predicted: groups, R², costs, tables and pictures.

Groups (Figures 14 and 15) have at most three parameters in a multi-task GP. Entries of one
eigenvector at the two points of one direction go together; of what is left over, one kind of
parameter of the modes of low frequency, and of those of high. Nine modes make 70 models of 144
parameters. Each is fitted as published: B free, the greatest likelihood. What the paper says of its
cross-validation ("training data of other m−1 modal parameters in the same model is additionally
used") can be read in two ways, and both are computed: nothing of a tested posture is known, or the
other parameters of the group are known there.
"""

import time
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from scipy.linalg import cho_factor, cho_solve

from planner.report.plot_marks import name_axes, panels
from planner.studies import drawing
from planner.studies.report import Table
from planner.surrogate.kernels import parse
from planner.surrogate.models.multitask import RANK, MultiTaskGP, fit_multitask

from .data import LEFT, RIGHT

PARTS = 16  # parameters of a mode
MOST = 3  # tasks of a group
LOW_MODES = 5  # modes 1 to 5 are of low frequency


def groups(labels: np.ndarray, reference: np.ndarray) -> list[np.ndarray]:
    """Columns of each group among the parameters of modes `labels` (k,), counted from 0.

    `reference` (k,): the entry of L that is 1, in the order 1X, 1aX, 1Y, 1aY.
    """
    found, alone = [], []
    for place, one in enumerate(reference):
        first = PARTS * place
        for point in (0, 2):  # R at 1X and 1aX, at 1Y and 1aY
            found += [first + RIGHT.start + 2 * point + part + np.array([0, 2]) for part in (0, 1)]
        pair, single = (0, 2) if one >= 2 else (1, 0)  # among the three entries of L that are left
        left = first + LEFT.start
        found += [left + 2 * pair + part + np.array([0, 2]) for part in (0, 1)]
        alone.append([first, first + 1, left + 2 * single, left + 2 * single + 1])
    kinds = np.array(alone)
    for modes in (labels < LOW_MODES, labels >= LOW_MODES):
        for kind in kinds[modes].T:
            found += [part for part in np.array_split(kind, -(-len(kind) // MOST)) if len(part)]
    return found


def predict(
    x: np.ndarray, y: np.ndarray, train: np.ndarray, wanted: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Predictions (q, m) of y (n, m) at x (n, d) where `train` (n,) is False, group by group.

    With nothing known there, and with the other parameters of the group known there.
    """
    test = ~train
    nothing, others = np.empty((2, test.sum(), y.shape[1]))
    for group in wanted:
        model = fit_multitask(x[train], y[np.ix_(train, group)], prior=False)
        nothing[:, group] = model.predict(x[test])[0]
        others[:, group] = _others_known(model, x, y[:, group], test)
    return nothing, others


def _others_known(model: MultiTaskGP, x: np.ndarray, y: np.ndarray, test: np.ndarray) -> np.ndarray:
    """Means (q, t) of each task where it is left out at the tested postures, and no other is."""
    h, n = model.hyperparameters, len(x)
    k = parse(model.tasks.kernel, x.shape[1]).covariance(np, h.theta, x, x)
    noiseless = np.kron(h.task_covariance, k)
    noisy = noiseless + np.kron(np.diag(h.noise), np.eye(n))
    scaled = ((y - model.tasks.centre) / model.tasks.scale).T.ravel()
    told = np.empty((int(test.sum()), y.shape[1]))
    for task in range(y.shape[1]):
        asked = task * n + np.flatnonzero(test)
        known = np.setdiff1d(np.arange(len(scaled)), asked)
        alpha = cho_solve(cho_factor(noisy[np.ix_(known, known)]), scaled[known])
        told[:, task] = noiseless[np.ix_(asked, known)] @ alpha
    return model.tasks.centre + model.tasks.scale * told


COUNTS, FEW_COUNTS = (1, 2, 3, 4, 5, 9, 36, 72, 144), (1, 3, 9)
MOST_DIRECT = 9  # tasks of which the whole matrix is factored: n·m = 1,008 rows
POSTURES = 112
PAPER_S = {1: 2.06, 2: 3.06, 3: 3.36, 4: 51.13, 5: 88.86}


def cost_table(small: bool = False) -> Table:
    """Seconds of one processor against m, of made-up tasks at 112 postures; and how exact it is."""
    rng = np.random.default_rng(0)
    x = rng.random((POSTURES, 3))
    smooth = np.column_stack([np.sin(4 * x[:, 0]), np.cos(3 * x[:, 1]), x[:, 2] * x[:, 0]])
    rows = []
    for m in FEW_COUNTS if small else COUNTS:
        y = smooth @ rng.standard_normal((3, m)) + 0.1 * rng.standard_normal((POSTURES, m))
        fit_multitask(x[:8], y[:8], rank=min(m, RANK))  # compiles
        start = time.process_time()
        fitted = fit_multitask(x, y, rank=min(m, RANK))
        seconds = time.process_time() - start
        h = fitted.hyperparameters
        direct, differs = float("nan"), float("nan")
        if m <= MOST_DIRECT:
            start = time.process_time()
            k = parse("rbf", 3).covariance(np, h.theta, x, x)
            k = k + 1e-9 * np.mean(np.diag(k)) * np.eye(POSTURES)
            noise = np.diag(h.noise)
            whole = np.kron(h.task_covariance, k) + np.kron(noise, np.eye(POSTURES))
            root = cho_factor(whole, lower=True)[0]
            direct = time.process_time() - start
            white = np.linalg.solve(np.tril(root), fitted.tasks.y.T.ravel())
            size = np.log(np.diag(root)).sum() + 0.5 * len(whole) * np.log(2 * np.pi)
            differs = abs(float(-0.5 * white @ white - size) - fitted.solved.value)
        rows.append((f"{m}", seconds, direct, differs, PAPER_S.get(m, float("nan"))))
    columns = ("m", "training, s", "one direct Cholesky, s", "log-likelihoods differ by",
               "paper: training, s")  # fmt: skip
    return Table("lei2023_cost", "Cost of m tasks in one multi-task GP", columns, tuple(rows))


OF_KIND = {
    "frequency": (0,),
    "damping ratio": (1,),
    "L, real parts": range(LEFT.start, LEFT.stop, 2),
    "L, imaginary parts": range(LEFT.start + 1, LEFT.stop, 2),
    "R, real parts": range(RIGHT.start, RIGHT.stop, 2),
    "R, imaginary parts": range(RIGHT.start + 1, RIGHT.stop, 2),
}
ALONE, GROUPS, KNOWN = "one by one", "groups of three", "groups, others known"  # as published
BY_KIND, AT_ONCE = "by kind", "all at once"  # ours
WAYS = (ALONE, GROUPS, KNOWN, BY_KIND, AT_ONCE)
OURS = f" ({BY_KIND} and {AT_ONCE} are ours)"
HEARD = 0.5  # of a parameter's variance that is not scatter, from which it is counted
COLUMNS = (*(f"{way}: {what}" for way in WAYS for what in ("mean", "spread")), "scatter allows")


@dataclass(frozen=True, eq=False)
class RobotScores:
    """R² (ways, folds, m) of one robot, what scatter of hits allows (m,), and seconds by way.

    `models`: how many groups there are. `off`: errors in % of what groups predict for the
    frequencies and damping ratios of all tested postures.
    """

    labels: np.ndarray
    r2: np.ndarray
    ceiling: np.ndarray
    seconds: dict[str, float]
    models: int
    off: dict[str, np.ndarray]

    def of(self, way: str) -> np.ndarray:
        """R² (folds, m') of the parameters that vary by more than their scatter."""
        return self.r2[WAYS.index(way)][:, self.ceiling > HEARD]


def kinds(count: int) -> dict[str, np.ndarray]:
    """Columns of each kind among the parameters of so many modes."""
    number = np.arange(count * PARTS).reshape(count, PARTS)
    return {kind: number[:, list(parts)].ravel() for kind, parts in OF_KIND.items()}


def shares(scores: list[RobotScores], way: str) -> tuple[float, float]:
    """Shares of parameters that are better (mean) and steadier (spread) than one by one.

    Of those that vary by more than their scatter.
    """
    better, steadier = [], []
    for each in scores:
        other, one = each.of(way), each.of(ALONE)
        better.append(other.mean(axis=0) > one.mean(axis=0))
        steadier.append(other.std(axis=0, ddof=1) < one.std(axis=0, ddof=1))
    return float(np.concatenate(better).mean()), float(np.concatenate(steadier).mean())


def median(scores: list[RobotScores], way: str) -> float:
    """Median R² of the parameters that vary by more than their scatter."""
    return float(np.median(np.concatenate([s.of(way).mean(axis=0) for s in scores])))


def apart(scores: list[RobotScores], way: str) -> float:
    """By how much R² differs from one by one, median over the same parameters."""
    each = [np.abs(s.of(way).mean(axis=0) - s.of(ALONE).mean(axis=0)) for s in scores]
    return float(np.median(np.concatenate(each)))


def _middle(scores: list[RobotScores], which: str | int) -> list[float]:
    """Medians over some outputs of each way's mean and spread over folds; and the ceiling.

    `which`: a kind, or the frequency of a mode (from 0).
    """
    columns = [
        kinds(len(s.labels))[which] if isinstance(which, str)
        else PARTS * np.flatnonzero(s.labels == which)
        for s in scores
    ]  # fmt: skip
    values = []
    for i in range(len(WAYS)):
        parts = [s.r2[i][:, c] for s, c in zip(scores, columns, strict=True)]
        values.append(np.median(np.concatenate([p.mean(axis=0) for p in parts])))
        values.append(np.median(np.concatenate([p.std(axis=0, ddof=1) for p in parts])))
    ceiling = np.concatenate([s.ceiling[c] for s, c in zip(scores, columns, strict=True)])
    return [float(v) for v in (*values, np.median(ceiling))]


def by_kind(scores: list[RobotScores]) -> Table:
    """R² of each kind of parameter by each way."""
    rows = [(kind, *_middle(scores, kind)) for kind in OF_KIND]
    return Table(
        "lei2023_kinds", f"R² over folds by kind of parameter, medians over modes and robots{OURS}",
        ("outputs", *COLUMNS), tuple(rows),
    )  # fmt: skip


def by_mode(scores: list[RobotScores]) -> Table:
    """R² of each mode's frequency by each way."""
    labels = sorted(set.intersection(*(set(s.labels.tolist()) for s in scores)))
    rows = [(f"mode {k + 1}", *_middle(scores, k)) for k in labels]
    return Table(
        "lei2023_frequencies", f"R² over folds of natural frequencies, medians over robots{OURS}",
        ("mode", *COLUMNS), tuple(rows),
    )  # fmt: skip


def figure(table: Table, title: str, floor: float) -> Figure:
    """A table by kind or by mode as bars; what lies below `floor` is cut."""
    figure, grid = panels((10.0, 6.4), f"{title}, by cross-validation", 2)
    values = np.array([row[1:] for row in table.rows], dtype=float)
    groups = [str(row[0]) for row in table.rows]
    mean = values[:, [-1, *range(0, 2 * len(WAYS), 2)]]
    names = "scatter allows", *WAYS
    drawing.bars(grid[0, 0], groups, names, mean, "R², mean over folds", floor)
    spread = values[:, 1 : 2 * len(WAYS) : 2]
    drawing.bars(grid[1, 0], groups, WAYS, spread, "R², spread over folds")
    grid[1, 0].set_yscale("log")  # one mode that no way predicts must not hide the others
    name_axes(figure, grid)
    return figure
