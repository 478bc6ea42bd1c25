"""Answer of `study`: tables, pictures, and what of the paper's findings holds here."""

from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Group, RenderableType
from rich.text import Text

from planner.report.answer import Answer
from planner.report.text import table
from planner.studies.report import Cell, PaperClaim, Report, Table


@dataclass(frozen=True)
class StudyAnswer(Answer):
    """Answer of `study`; `files` are absolute paths."""

    study: str
    data: str
    tables: tuple[Table, ...]
    findings: tuple[PaperClaim, ...]
    files: list[str] = field(default_factory=list)
    seconds: float = 0.0

    @classmethod
    def of(cls, report: Report, files: list[str], seconds: float) -> "StudyAnswer":
        """Of a study that took so many seconds and was written to these files."""
        return cls(report.study, report.data, report.tables, report.findings, files, seconds)

    def text(self) -> Group:
        """All tables, then finding by finding."""
        parts: list[RenderableType] = [Text(self.data, style="bold magenta")]
        for entry in self.tables:
            made = table(entry.title, *entry.columns)
            for row in entry.rows:
                made.add_row(*map(_cell, row))
            parts.append(made)
        for finding in self.findings:
            verdict = ("holds", "green") if finding.holds else ("does not hold", "red")
            parts.append(Text.assemble(verdict, f": {finding.paper}\n    {finding.here}"))
        if self.files:
            parts.append(f"{len(self.files)} files in {Path(self.files[0]).parent}")
        return Group(*parts)


def _cell(value: Cell) -> str:
    if isinstance(value, str):
        return value
    return "–" if value != value else f"{value:.4g}"
