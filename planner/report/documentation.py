"""Every entry of the TOML files that a user writes (`schema`), told by the types that read them.

And the manual.
"""

import inspect
from collections.abc import Iterator, Sequence
from typing import Any

import msgspec
from msgspec import inspect as types
from rich.console import Group, RenderableType
from rich.text import Text

from planner.campaign.config import AcquisitionTable, CampaignConfig, SurrogateTable
from planner.campaign.store import EXAMPLE
from planner.errors import InputError
from planner.milling.cut import Cut
from planner.milling.tool import ToolTable
from planner.report.answer import Done
from planner.report.html import rendered
from planner.report.text import table
from planner.robot.config import RobotConfig

FILES: dict[str, type[msgspec.Struct]] = {
    "robot": RobotConfig, "campaign": CampaignConfig, "cut": Cut, "tool": ToolTable,
}  # fmt: skip
REQUIRED = "required"


def schema(file: str) -> Done:
    """Tables of one of FILES in the file's order, and a JSON Schema for editors.

    InputError for others.
    """
    if file not in FILES:
        raise InputError(f"There is no file {file}; name one of {', '.join(FILES)}.")
    kind, parts = FILES[file], list[RenderableType]()
    tables, name = tuple(tables_of(kind)), f"{file}.toml"
    for one in tables:
        columns, title = ("entry", "takes", "if left out"), one["name"] or name
        rows = (map(Text, entry.values()) for entry in one["entries"])
        made = table(Text(title, style="bold"), *columns, rows=rows, words=True)
        parts += [made, Text(one["about"])]
        parts += [Text(f"  {': '.join(choice.values())}") for choice in one["choices"]]
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


def tables_of(kind: type[msgspec.Struct], name: str = "") -> Iterator[dict[str, Any]]:
    """The table of a type, then those of its entries that are tables themselves.

    "name" is "" for what stands at the file's top; "about" may have several sentences. Of "entries"
    "default" is what holds where one is left out; "choices" are what the table's name or model may
    be, where that is one of several.
    """
    info = types.type_info(kind)
    assert isinstance(info, types.StructType)
    entries, inner = [], []
    for field in info.fields:
        struct, form = _struct(field.type)
        if struct is None:
            takes, default = _takes(field.type), _default(field)
            entries.append({"name": field.encode_name, "takes": takes, "default": default})
        else:
            path = f"{name.strip('[]')}.{field.encode_name}".strip(".")
            inner.append((struct, form.format(path)))
    about = " ".join((inspect.getdoc(kind) or "").split())
    choices = [{"name": name, "about": said} for name, said in _choices(kind).items()]
    yield {"name": name, "about": about, "entries": entries, "choices": choices}
    for struct, path in inner:
        yield from tables_of(struct, path)


def _choices(kind: type[msgspec.Struct]) -> dict[str, str]:
    """Acquisitions or models, where the table names one, and what each stands for."""
    if kind is SurrogateTable:
        from planner.surrogate.frequency_models import MODELS

        return {name: model.sentence for name, model in MODELS.items()}
    if kind is not AcquisitionTable:
        return {}
    from planner.design.propose import ACQUISITIONS, DESCRIPTIONS, DESIGNS

    return {name: DESCRIPTIONS[name] for name in (*ACQUISITIONS, *DESIGNS)}


def _struct(given: types.Type) -> tuple[type[msgspec.Struct] | None, str]:
    """The type of a table, of those in a list or by name, and how its head is written."""
    for one in _alternatives(given):
        if isinstance(one, types.StructType):
            return one.cls, "[{}]"
        inner: object = getattr(one, "item_type", getattr(one, "value_type", None))
        if isinstance(inner, types.StructType):
            return inner.cls, "[{}.NAME]" if isinstance(one, types.DictType) else "[[{}]]"
    return None, ""


def _alternatives(given: types.Type) -> tuple[types.Type, ...]:
    return given.types if isinstance(given, types.UnionType) else (given,)


_WORDS: dict[type, str] = {
    types.StrType: "text", types.IntType: "whole number", types.FloatType: "number",
    types.BoolType: "true or false",
}  # fmt: skip


def _takes(given: types.Type) -> str:
    """What an entry takes, in words."""
    known = [
        t for t in _alternatives(given) if not isinstance(t, types.NoneType)
        and type(t).__name__ != "UnsetType"
    ]  # fmt: skip
    return " or ".join(_word(t) for t in known)


def _word(given: types.Type) -> str:
    if isinstance(given, types.Metadata):  # with `toml_file.limited`
        return _word(given.type)
    if isinstance(given, types.LiteralType):
        return " or ".join(f'"{v}"' if isinstance(v, str) else str(v) for v in given.values)
    if isinstance(given, types.TupleType):
        return f"[{', '.join(_takes(t) for t in given.item_types)}]"
    if isinstance(given, types.VarTupleType | types.ListType):
        return f"list of {_takes(given.item_type)}"
    if isinstance(given, types.DictType):
        return "table"
    return _WORDS.get(type(given), "value")


def _default(field: types.Field) -> str:
    if field.required:
        return REQUIRED
    value = field.default
    if value is msgspec.NODEFAULT:
        value = field.default_factory() if callable(field.default_factory) else None
        if value is msgspec.UNSET:
            return REQUIRED  # unless the same is stated in another unit
    if value is None or value is msgspec.UNSET:
        return "not used"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple | list | dict):
        return "[" + ", ".join(str(v) for v in value) + "]" if value else "none"
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"
