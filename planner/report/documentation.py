"""Every entry of the TOML files that a user writes (`schema`), and the manual."""

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from typing import Any

import msgspec
from rich.console import Group
from rich.text import Text

from planner.campaign.file_entries import FILES, SchemaTable, tables_of
from planner.campaign.store import EXAMPLE
from planner.errors import InputError
from planner.report.answer import Answer
from planner.report.html import rendered
from planner.report.text import table


@dataclass(frozen=True)
class SchemaReport(Answer):
    """Answer of `schema`: tables in the file's order; `json_schema` is for editors."""

    file: str
    tables: tuple[SchemaTable, ...]
    json_schema: dict[str, Any]

    def text(self) -> Group:
        """One table after the other."""
        parts: list[Any] = []
        for one in self.tables:
            columns, title = ("entry", "takes", "if left out"), one.name or self.file
            rows = (map(Text, astuple(entry)) for entry in one.entries)
            made = table(Text(title, style="bold"), *columns, rows=rows, words=True)
            parts += [made, Text(one.about)]
            parts += [Text(f"  {choice.name}: {choice.about}") for choice in one.choices]
            parts.append(Text(""))
        return Group(*parts)


def schema(file: str) -> SchemaReport:
    """Of one of FILES; InputError for others."""
    if file not in FILES:
        raise InputError(f"There is no file {file}; name one of {', '.join(FILES)}.")
    kind = FILES[file]
    return SchemaReport(f"{file}.toml", tuple(tables_of(kind)), msgspec.json.schema(kind))


def manual(commands: Sequence[tuple[str, str]]) -> str:
    """Chapters of words, the files' entries, and commands, which are names and their help."""
    files = {
        name: (next(EXAMPLE.rglob(f"{name}.toml")).read_text("utf-8"), list(tables_of(kind)))
        for name, kind in FILES.items()
    }
    told = []
    for name, text in commands:
        said, _, example = text.replace("`", "").partition("Example: ")  # help is Markdown
        paragraphs = [one for one in said.split("\n\n") if one.strip()]
        told.append((name, paragraphs, " ".join(example.split())))
    return rendered("manual.html", title="planner: manual", files=files, commands=told)
