"""What a study answers: tables, pictures and judged claims; its answer as JSON, text and files."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import msgspec
import numpy as np
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.text import Text

from planner.inference.parallel import parallel_map
from planner.progress import ProgressCallback, no_progress, part_of
from planner.report.answer import Answer
from planner.report.text import table
from planner.studies.claims import COLUMNS, HOLDS, IN_KIND, NOT, UNTESTED, PaperClaim

if TYPE_CHECKING:
    from matplotlib.figure import Figure

R = TypeVar("R")
Cell = str | float
COLOURS = {HOLDS: "bold green", IN_KIND: "bold yellow", NOT: "bold red", UNTESTED: "bold"}


@dataclass(frozen=True)
class Paper:
    """Where a study's claims come from."""

    authors: str
    year: int
    title: str
    published: str

    @property
    def short(self) -> str:
        """Such as "Busch et al. 2022"."""
        return f"{self.authors.split(',')[0]} et al. {self.year}"

    @property
    def citation(self) -> str:
        """Authors, year, title and journal in one line."""
        return f"{self.authors} ({self.year}). {self.title}. {self.published}."


@dataclass(frozen=True)
class Table:
    """Numbers under column names; the first column says what a row is."""

    name: str  # of its file
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]


@dataclass(frozen=True, eq=False)
class Report:
    """What a study found; `data` says what stands in for the paper's recordings.

    `figures` of each robot are what claims are judged on, by name; `notes` say what lies behind.
    """

    data: str
    tables: tuple[Table, ...]
    figures: Sequence[Mapping[str, float]]
    notes: Mapping[str, str]
    pictures: "dict[str, Figure]" = field(default_factory=dict)


@dataclass(frozen=True)
class StudyAnswer(Answer):
    """Answer of `study NAME`; `files` are absolute paths, `small` a version cut down for tests."""

    study: str
    data: str
    tables: tuple[Table, ...]
    findings: tuple[PaperClaim, ...]
    files: list[str] = field(default_factory=list)
    seconds: float = 0.0
    paper: str = ""
    small: bool = False
    short: str = ""

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> "StudyAnswer":
        """What `to_json` gave; missing numbers (null) are NaN again."""
        tables = [
            {**t, "rows": [[float("nan") if v is None else v for v in row] for row in t["rows"]]}
            for t in data["tables"]
        ]
        return msgspec.convert({**data, "tables": tables}, cls, strict=False)

    def count(self, verdict: str) -> int:
        """How many claims have this verdict."""
        return sum(claim.verdict == verdict for claim in self.findings)

    @property
    def claims(self) -> Table:
        """Claim by claim: verdict, the paper's figures and those here, rule and reason."""
        columns = f"claim of {self.short}", *COLUMNS
        rows = tuple(row for claim in self.findings for row in claim.rows)
        return Table(f"{self.study}_claims", f"Claims of {self.short}", columns, rows)

    def text(self) -> Group:
        """All tables, then the claims."""
        parts: list[RenderableType] = [Text(self.data, style="bold magenta")]
        parts += [
            table(one.title, *one.columns, rows=(map(shown_cell, row) for row in one.rows))
            for one in self.tables
        ]
        parts += _claims(self)
        if self.files:
            parts.append(f"{len(self.files)} files in {Path(self.files[0]).parent}")
        return Group(*parts)


@dataclass(frozen=True)
class StudiesAnswer(Answer):
    """Answer of `study all`; `taken` names those that were finished before and not run again.

    `damaged` names those that were run again because what was kept of them was damaged.
    """

    studies: tuple[StudyAnswer, ...]
    taken: tuple[str, ...]
    files: list[str]
    seconds: float
    damaged: tuple[str, ...] = ()

    def text(self) -> Group:
        """The claims of all studies, and where the rest is."""
        parts: list[RenderableType] = [p for study in self.studies for p in _claims(study)]
        if self.taken:
            parts.append(f"finished before, and not run again: {', '.join(self.taken)}")
        if self.damaged:
            parts.append(f"kept before, but damaged, and run again: {', '.join(self.damaged)}")
        parts.append(f"all pages: {self.files[0]}")
        return Group(*parts)


def shown_cell(value: Cell) -> str:
    """A table's entry as text and page have it."""
    if isinstance(value, str):
        return value
    return "–" if value != value else f"{value:.4g}"


def on_each(
    seeds: Sequence[int], run: Callable[[int, ProgressCallback], R], progress: ProgressCallback
) -> list[R]:
    """What a study's `run` gives of the robot of every seed, on two cores."""
    return parallel_map(_RobotRun(run, len(seeds), progress), list(enumerate(seeds)))


@dataclass(frozen=True)
class _RobotRun(Generic[R]):
    """`run` of one robot of several, here or in another process, which tells no progress."""

    run: Callable[[int, ProgressCallback], R]
    count: int
    progress: ProgressCallback

    def __call__(self, robot: tuple[int, int]) -> R:
        number, seed = robot
        part = part_of(self.progress, number / self.count, (number + 1) / self.count)
        return self.run(seed, part)

    def __reduce__(self) -> tuple[Callable, tuple]:
        return _RobotRun, (self.run, self.count, no_progress)


def r_squared(predicted: np.ndarray, measured: np.ndarray, axis: int | None = None) -> np.ndarray:
    """Coefficient of determination R² over an axis (all if None); NaN was not measured."""
    off = np.nanmean((predicted - measured) ** 2, axis=axis)
    return 1 - off / np.nanvar(measured, axis=axis)


def _claims(answer: StudyAnswer) -> list[RenderableType]:
    """Claim by claim, a line for each figure of it: eight columns are too many for a screen."""
    parts: list[RenderableType] = [Text(f"\nClaims of {answer.short}", style="italic")]
    for claim in answer.findings:
        head = (f"{claim.verdict}: ", COLOURS[claim.verdict]), (claim.sentence, "bold")
        parts.append(Text.assemble(*head))
        for figure in claim.figures:
            name, paper, here, spread, false_if, reason = figure.cells
            theirs = "" if paper == "–" else f"the paper: {paper}; "
            told = f"{here} ({spread}); {theirs}false if {false_if}; {reason}"
            parts.append(Padding(Text(f"{name}: {told}"), (0, 0, 0, 4)))
    return parts
