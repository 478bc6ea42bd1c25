"""The manual: chapters of words, the files' entries from the types that read them, commands."""

from collections.abc import Sequence
from pathlib import Path

from planner.campaign.example import EXAMPLE
from planner.errors import InputError
from planner.report.manual.words import folder, numbers, python, recordings, tutorial
from planner.report.page.html import Markup, document, joined, section, tag, words_table
from planner.report.schema import FILES, schema
from planner.version import __version__


def manual(commands: Sequence[tuple[str, str]]) -> str:
    """The whole file; `commands` are names and their help."""
    parts = [
        tutorial(), *(_file(name) for name in FILES), recordings(), folder(), _commands(commands),
        python(), numbers(),
    ]  # fmt: skip
    links = ("tutorial", *FILES, "recordings", "folder", "commands", "python", "numbers")
    head = (
        tag("h1", "planner: manual"),
        tag("p", f"Version {__version__}. planner --help and planner COMMAND --help say the same "
            "of each command.", class_="soft"),
        tag("nav", *(tag("a", name, href=f"#{name}") for name in links)),
    )  # fmt: skip
    return document("planner: manual", *head, *parts)


def write_manual(out: Path, commands: Sequence[tuple[str, str]]) -> Path:
    """Write it; InputError where that is impossible."""
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(manual(commands), encoding="utf-8")
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror}); name another.") from None
    return out.absolute()


def _file(name: str) -> Markup:
    """A TOML file: the shipped example, then every entry."""
    parts: list[Markup] = [tag("pre", next(EXAMPLE.rglob(f"{name}.toml")).read_text("utf-8"))]
    for one in schema(name).tables:
        rows = [(entry.name, entry.takes, entry.default) for entry in one.entries]
        parts.append(tag("h3", one.name or f"{name}.toml, at its top"))
        parts.append(tag("p", one.about.replace("`", "")))
        parts += [words_table(("entry", "takes", "if left out"), rows)] if rows else []
        if one.choices:
            named = [(choice.name, choice.about) for choice in one.choices]
            parts.append(words_table(("name", "chooses"), named))
    return section(f"{name}.toml", joined(parts), id_=name)


def _commands(commands: Sequence[tuple[str, str]]) -> Markup:
    parts = []
    for name, text in commands:
        said, _, example = text.partition("Example: ")
        parts.append(tag("h3", f"planner {name}"))
        parts += [tag("p", p) for p in said.split("\n\n") if p.strip()]
        parts += [tag("pre", " ".join(example.split()))] if example else []
    return section("Commands", joined(parts), id_="commands")
