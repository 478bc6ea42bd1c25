"""Answer of `schema`: every entry of a TOML file that a user writes."""

from dataclasses import dataclass
from typing import Any

import msgspec
from rich.console import Group
from rich.text import Text

from planner.campaign.file_entries import FILES, SchemaTable, tables_of
from planner.errors import InputError
from planner.report.answer import Answer
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
            made = table("", "entry", "takes", "if left out")
            made.title = Text(one.name or self.file, style="bold")
            for column in made.columns:
                column.justify = "left"
            for entry in one.entries:
                made.add_row(*(Text(v) for v in (entry.name, entry.takes, entry.default)))
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
