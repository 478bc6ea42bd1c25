"""R² of the ways in which Lei et al. 2023's parameters are predicted: tables and pictures."""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from planner.studies import drawing
from planner.studies.lei2023_data import LEFT, RIGHT
from planner.studies.lei2023_groups import PARTS
from planner.studies.report import Table

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


def kinds_figure(table: Table) -> Figure:
    """The table by kind as bars."""
    return _figure(table, "Modal parameters of all postures, by cross-validation", -0.5)


def modes_figure(table: Table) -> Figure:
    """The table by mode as bars."""
    return _figure(table, "Natural frequencies, by cross-validation", 0.0)


def _figure(table: Table, title: str, floor: float) -> Figure:
    figure = drawing.new((10.0, 6.4), title)
    panels = figure.subplots(2, 1, sharex=True)
    values = np.array([row[1:] for row in table.rows], dtype=float)
    groups = [str(row[0]) for row in table.rows]
    mean = values[:, [-1, *range(0, 2 * len(WAYS), 2)]]
    names = "scatter allows", *WAYS
    drawing.bars(panels[0], groups, names, mean, "R², mean over folds", floor)
    spread = values[:, 1 : 2 * len(WAYS) : 2]
    drawing.bars(panels[1], groups, WAYS, spread, "R², spread over folds")
    drawing.legend(figure, panels[0])
    return figure
