"""What a study answers: tables, pictures, and the paper's findings with whether they hold here."""

import csv
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from planner.errors import InputError
from planner.report.plot_files import Pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Cell = str | float


@dataclass(frozen=True)
class Table:
    """Numbers under column names; the first column says what a row is."""

    name: str  # of its file
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]


@dataclass(frozen=True)
class PaperClaim:
    """A sentence of the paper, the figures found here, and whether they bear it out."""

    paper: str
    here: str
    holds: bool


@dataclass(frozen=True, eq=False)
class Report:
    """A study's answer; `data` says what stands in for the paper's recordings."""

    study: str
    data: str
    tables: tuple[Table, ...]
    findings: tuple[PaperClaim, ...]
    figures: "dict[str, Figure]" = field(default_factory=dict)

    def table(self, name: str) -> Table:
        """The table of that name; KeyError if there is none."""
        return {t.name: t for t in self.tables}[name]


def r_squared(predicted: np.ndarray, measured: np.ndarray, axis: int | None = None) -> np.ndarray:
    """Coefficient of determination R² over an axis (all entries if None)."""
    return 1 - np.mean((predicted - measured) ** 2, axis=axis) / np.var(measured, axis=axis)


def check_folder(folder: Path | None) -> None:
    """InputError, before a study has run for minutes, if nothing can be written there."""
    if folder is None:
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"The study cannot write to {folder} ({error.strerror}); name another folder."
        ) from None


def write(report: Report, folder: Path | None) -> list[str]:
    """Tables as CSV and pictures as PNG; absolute paths of all files."""
    if folder is None:
        return []
    files = []
    for table in report.tables:
        path = folder.absolute() / f"{table.name}.csv"
        try:
            with path.open("w", newline="", encoding="utf-8") as out:
                csv.writer(out).writerows([table.columns, *table.rows])
        except OSError as error:
            raise InputError(
                f"{path} cannot be written ({error.strerror}); name another folder."
            ) from None
        files.append(str(path))
    return files + Pictures(folder).write(report.figures, report.study)["plots"]
