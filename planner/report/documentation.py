"""Every entry of the TOML files that a user writes (`schema`), and the manual."""

from collections.abc import Sequence
from dataclasses import astuple

import msgspec
from rich.console import Group, RenderableType
from rich.text import Text

from planner.campaign.file_entries import FILES, tables_of
from planner.campaign.store import EXAMPLE
from planner.errors import InputError
from planner.report.answer import Done
from planner.report.html import rendered
from planner.report.text import table


def schema(file: str) -> Done:
    """Tables of one of FILES in the file's order, and a JSON Schema for editors.

    InputError for others.
    """
    if file not in FILES:
        raise InputError(f"There is no file {file}; name one of {', '.join(FILES)}.")
    kind, parts = FILES[file], list[RenderableType]()
    tables, name = tuple(tables_of(kind)), f"{file}.toml"
    for one in tables:
        columns, title = ("entry", "takes", "if left out"), one.name or name
        rows = (map(Text, astuple(entry)) for entry in one.entries)
        made = table(Text(title, style="bold"), *columns, rows=rows, words=True)
        parts += [made, Text(one.about)]
        parts += [Text(f"  {choice.name}: {choice.about}") for choice in one.choices]
        parts.append(Text(""))
    keys = {"file": name, "tables": tables, "json_schema": msgspec.json.schema(kind)}
    return Done(keys, Group(*parts))


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
