"""Answer of `study`: tables, pictures, and what of the paper's findings holds here."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
from rich.console import Group, RenderableType
from rich.text import Text

from planner.report.answer import Answer
from planner.report.text import table
from planner.studies.papers import PAPERS
from planner.studies.report import Cell, PaperClaim, Report, Table, claims_table


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

    @classmethod
    def of(
        cls, report: Report, files: list[str], seconds: float, small: bool = False
    ) -> "StudyAnswer":
        """Of a study that took so many seconds and was written to these files."""
        citation = PAPERS[report.study].citation
        return cls(
            report.study, report.data, report.tables, report.findings, files, seconds, citation,
            small,
        )  # fmt: skip

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> "StudyAnswer":
        """What `to_json` gave; missing numbers (null) are NaN again."""
        tables = [
            {**t, "rows": [[float("nan") if v is None else v for v in row] for row in t["rows"]]}
            for t in data["tables"]
        ]
        return msgspec.convert({**data, "tables": tables}, cls, strict=False)

    @property
    def claims(self) -> Table:
        """Claim by claim: whether it holds here, what was computed, and why not."""
        return claims_table(self.study, self.findings)

    def text(self) -> Group:
        """All tables, then the claims."""
        parts: list[RenderableType] = [Text(self.data, style="bold magenta")]
        parts += [_shown(entry) for entry in (*self.tables, self.claims)]
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
        parts: list[RenderableType] = [_shown(study.claims) for study in self.studies]
        if self.taken:
            parts.append(f"finished before, and not run again: {', '.join(self.taken)}")
        if self.damaged:
            parts.append(f"kept before, but damaged, and run again: {', '.join(self.damaged)}")
        parts.append(f"all pages: {self.files[0]}")
        return Group(*parts)


def _shown(entry: Table) -> RenderableType:
    made = table(entry.title, *entry.columns)
    for row in entry.rows:
        made.add_row(*(_cell(value) for value in row))
    return made


def _cell(value: Cell) -> str:
    if isinstance(value, str):
        return value
    return "–" if value != value else f"{value:.4g}"
