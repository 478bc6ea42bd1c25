"""The study of Lei et al. 2023: 144 modal parameters at 112 postures, together and one by one.

Parameters are grouped by kind (all frequencies, all damping ratios, L and R, real and imaginary),
which was chosen with robots 1 and 2.
"""

import time
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from planner.progress import Tell
from planner.studies import drawing
from planner.studies.lei2023_data import (
    LEFT,
    MODES,
    RIGHT,
    parameters,
    postures,
    scatter,
    true_robot,
)
from planner.studies.models.fidelity_levels import Samples
from planner.studies.models.multitask import fit_multitask
from planner.studies.models.single_output_gp import fit_gp
from planner.studies.report import PaperClaim, Report, Table, r_squared

ROBOTS = (11, 12, 13)
FOLDS = 5
PAPER_S = 3.36  # for one group of three outputs
PARTS = 16
NUMBER = np.arange(MODES * PARTS).reshape(MODES, PARTS)
KINDS = {
    "frequency": NUMBER[:, 0],
    "damping ratio": NUMBER[:, 1],
    "L, real parts": NUMBER[:, LEFT][:, ::2].ravel(),
    "L, imaginary parts": NUMBER[:, LEFT][:, 1::2].ravel(),
    "R, real parts": NUMBER[:, RIGHT][:, ::2].ravel(),
    "R, imaginary parts": NUMBER[:, RIGHT][:, 1::2].ravel(),
}


@dataclass(frozen=True, eq=False)
class Scores:
    """R² (robots, folds, 144) together and alone, what scatter allows (robots, 144), seconds."""

    together: np.ndarray
    alone: np.ndarray
    ceiling: np.ndarray
    seconds: float


def study(progress: Tell, small: bool = False) -> Report:
    """R² by 5-fold cross-validation on three robots, and the time that training takes."""
    scores = _scores(progress)
    table, modes = _by_kind(scores), _by_mode(scores)
    better, steadier = _shares(scores)
    return Report(
        "lei2023",
        "SIMULATED: the KR240 with spindle in MuJoCo, seeds 11 to 13, with the scatter of a modal "
        "analysis: 0.2 % of f, 5 % of ζ, 5 % of a mode's L and R.",
        (table, modes),
        (
            PaperClaim(
                "144 parameters train in less time than the paper's group of three (3.36 s).",
                f"{scores.seconds:.2f} s of one processor for all 144",
                scores.seconds < PAPER_S,
            ),
            PaperClaim(
                "Together all parameters are predicted better than one by one (mean R²).",
                f"in {100 * better:.0f} % of the parameters that scatter does not bury",
                better > 0.95,
            ),
            PaperClaim(
                "Together all are predicted more steadily (spread of R² over folds).",
                f"in {100 * steadier:.0f} % of them",
                steadier > 0.95,
            ),
        ),
        {"lei2023_kinds": _kinds_figure(table), "lei2023_modes": _modes_figure(modes)},
    )


def _scores(progress: Tell) -> Scores:
    shape = len(ROBOTS), FOLDS, MODES * PARTS
    together, alone = np.empty((2, *shape))
    ceiling, spent = np.empty((shape[0], shape[2])), []
    for i, seed in enumerate(ROBOTS):
        progress(f"robot {seed}: 112 postures", i / shape[0])
        x, y, ceiling[i] = _data(seed)
        fold = np.random.default_rng(seed).permutation(len(x)) % FOLDS
        for j in range(FOLDS):
            progress(f"robot {seed}, fold {j + 1} of {FOLDS}", (i + j / FOLDS) / shape[0])
            train, test = fold != j, fold == j
            predicted, seconds = _together(x[train], y[train], x[test])
            spent.append(seconds)
            together[i, j] = r_squared(predicted, y[test], 0)
            alone[i, j] = r_squared(_alone(x[train], y[train], x[test]), y[test], 0)
    # The first robot's first fold also compiles.
    return Scores(together, alone, ceiling, float(np.max(spent[1:])))


def _data(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Postures (112, 3), measured parameters (112, 144), and the R² that scatter allows (144,)."""
    truth = true_robot(seed)
    q, x = postures(truth)
    clean = parameters(truth, q).reshape(len(q), -1)
    sd = scatter(clean.reshape(len(q), MODES, PARTS)).reshape(clean.shape)
    y = clean + sd * np.random.default_rng([seed, 1]).standard_normal(clean.shape)
    return x, y, 1 - np.mean(sd**2, axis=0) / np.var(y, axis=0)


def _together(x: np.ndarray, y: np.ndarray, there: np.ndarray) -> tuple[np.ndarray, float]:
    """BeyondPrediction values (q, 144) and the seconds of processor that training took."""
    start = time.process_time()
    models = [fit_multitask(x, y[:, kind]) for kind in KINDS.values()]
    seconds = time.process_time() - start
    predicted = np.empty((len(there), y.shape[1]))
    for kind, model in zip(KINDS.values(), models, strict=True):
        predicted[:, kind] = model.predict(there)[0]
    return predicted, seconds


def _alone(x: np.ndarray, y: np.ndarray, there: np.ndarray) -> np.ndarray:
    return np.column_stack(
        [fit_gp(Samples.of(x, column), "rbf").predict(there)[0] for column in y.T]
    )


def _heard(scores: Scores) -> np.ndarray:
    """Which parameters (robots, 144) vary by more than their scatter."""
    return scores.ceiling > 0.5


def _shares(scores: Scores) -> tuple[float, float]:
    """Shares of those parameters that are better (mean) and steadier (spread) together."""
    heard = _heard(scores)
    mean = scores.together.mean(axis=1) > scores.alone.mean(axis=1)
    spread = scores.together.std(axis=1, ddof=1) < scores.alone.std(axis=1, ddof=1)
    return float(mean[heard].mean()), float(spread[heard].mean())


def _middle(scores: Scores, which: np.ndarray) -> list[float]:
    """Medians over some outputs of the folds' mean and spread: together, alone; and the ceiling."""
    values = []
    for runs in (scores.together, scores.alone):
        part = runs[:, :, which]
        values += [np.median(part.mean(axis=1)), np.median(part.std(axis=1, ddof=1))]
    return [float(v) for v in (*values, np.median(scores.ceiling[:, which]))]


COLUMNS = ("together: mean", "spread", "one by one: mean", "spread", "scatter allows")


def _by_kind(scores: Scores) -> Table:
    rows = [(f"{kind} ({len(which)})", *_middle(scores, which)) for kind, which in KINDS.items()]
    return Table(
        "lei2023_kinds", "5-fold R² by kind of parameter: medians over modes and three robots",
        ("outputs", *COLUMNS), tuple(rows),
    )  # fmt: skip


def _by_mode(scores: Scores) -> Table:
    rows = [(f"mode {k + 1}", *_middle(scores, NUMBER[k, :1])) for k in range(MODES)]
    return Table(
        "lei2023_frequencies", "5-fold R² of natural frequencies: medians over three robots",
        ("mode", *COLUMNS), tuple(rows),
    )  # fmt: skip


def _kinds_figure(table: Table) -> Figure:
    return _figure(table, "144 modal parameters at 112 postures, 5-fold cross-validation", -0.5)


def _modes_figure(table: Table) -> Figure:
    return _figure(table, "Natural frequencies of nine modes, 5-fold cross-validation", 0.0)


def _figure(table: Table, title: str, floor: float) -> Figure:
    figure = drawing.new((10.0, 6.4), title)
    panels = figure.subplots(2, 1, sharex=True)
    values = np.array([row[1:] for row in table.rows], dtype=float)
    groups = [str(row[0]).replace(" (", "\n(") for row in table.rows]
    names = ("scatter allows", "one by one", "together")
    mean = values[:, [4, 2, 0]]
    drawing.bars(panels[0], groups, names, mean, "R², mean over folds", floor)
    drawing.bars(panels[1], groups, names[1:], values[:, [3, 1]], "R², spread over folds")
    drawing.legend(figure, panels[0])
    return figure
