"""The manual: chapters of words, the files' entries from the types that read them, commands."""

from collections.abc import Sequence
from dataclasses import astuple
from pathlib import Path

from planner.campaign.file_entries import FILES, tables_of
from planner.campaign.store import EXAMPLE
from planner.errors import InputError
from planner.report.page import rendered


def manual(commands: Sequence[tuple[str, str]]) -> str:
    """The whole file; `commands` are names and their help."""
    files = {}
    for name in FILES:
        tables = [
            {"name": one.name, "about": one.about, "entries": list(map(astuple, one.entries)),
             "choices": list(map(astuple, one.choices))}
            for one in tables_of(FILES[name])
        ]  # fmt: skip
        files[name] = next(EXAMPLE.rglob(f"{name}.toml")).read_text("utf-8"), tables
    told = []
    for name, text in commands:
        said, _, example = text.partition("Example: ")
        paragraphs = [one for one in said.split("\n\n") if one.strip()]
        told.append((name, paragraphs, " ".join(example.split())))
    return rendered("manual.html", title="planner: manual", files=files, commands=told)


def write_manual(out: Path, commands: Sequence[tuple[str, str]]) -> Path:
    """Write it; InputError where that is impossible."""
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(manual(commands), encoding="utf-8")
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror}); name another.") from None
    return out.absolute()
