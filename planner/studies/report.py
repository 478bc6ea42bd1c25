"""What a study answers: tables, pictures, and the paper's findings with whether they hold here."""

import csv
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from planner.errors import InputError
from planner.report.plot_files import Pictures
from planner.studies.papers import PAPERS

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
    """A sentence of the paper, the figures found here, and whether they bear it out.

    `why_not`, of what was computed too: what makes it fail here; empty where nothing tells.
    `ours`: it is no claim of the paper, but what is claimed for this program beside it.
    """

    paper: str
    here: str
    holds: bool
    why_not: str = ""
    ours: bool = False


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

    @property
    def claims(self) -> Table:
        """Claim by claim: whether it holds here, what was computed, and why not."""
        return claims_table(self.study, self.findings)


def claims_table(study: str, findings: "tuple[PaperClaim, ...]") -> Table:
    """The claims of a study's paper, and those made for this program beside it."""
    paper = PAPERS[study].short
    rows = tuple(
        (
            f"(this program) {claim.paper}" if claim.ours else claim.paper,
            "yes" if claim.holds else "no",
            claim.here,
            "" if claim.holds else claim.why_not or "what was computed contradicts it",
        )
        for claim in findings
    )
    columns = f"claim of {paper}", "holds here?", "computed here", "why not"
    return Table(f"{study}_claims", f"Claims of {paper}", columns, rows)


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
    files = [write_table(table, folder) for table in (*report.tables, report.claims)]
    return files + Pictures(folder).write(report.figures, report.study)["plots"]


def write_table(table: Table, folder: Path) -> str:
    """One table as CSV; the file's absolute path."""
    path = folder.absolute() / f"{table.name}.csv"
    try:
        with path.open("w", newline="", encoding="utf-8") as out:
            csv.writer(out).writerows([table.columns, *table.rows])
    except OSError as error:
        raise InputError(
            f"{path} cannot be written ({error.strerror}); name another folder."
        ) from None
    return str(path)
