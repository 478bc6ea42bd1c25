"""TOML files as typed values, every fault in one sentence."""

import difflib
import math
import re
import typing
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from planner import file_content
from planner.errors import InputError

T = TypeVar("T")
LONGEST = 40  # of a wrong value that is repeated
NAMES = "name", "joint", "link", "effect"  # entries by which one finds a table of a list


def limited(unit: str = "", **limits: Any) -> msgspec.Meta:
    """Of a number's type: what it must be above (`gt`), at least, below or at most (ge, lt, le)."""
    return msgspec.Meta(**limits, extra={"unit": f" {unit}".rstrip()})


def read_toml_text(path: Path, name: str) -> str:
    """Text of a TOML file, without a byte order mark; InputError naming file and remedy."""
    try:
        return file_content.read(path).decode("utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{path} does not exist; name a {name}.") from None
    except IsADirectoryError:
        found = [p for p in (path / name, path / "robot" / name) if p.is_file()]
        meant = f"name {found[0]}." if found else f"name a {name} in it."
        raise InputError(f"{path} is a folder; {meant}") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); name a file.") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not a valid {name} ({error}); correct it.") from None


def load_toml(path: Path, kind: type[T], name: str) -> T:
    """Decode a TOML file; InputError naming the file, the fault and the remedy.

    Numbers are finite: nan and inf are nothing that JSON, and so the log, could hold.
    """
    text = read_toml_text(path, name)
    try:
        found = msgspec.toml.decode(text, type=kind)
    except msgspec.ValidationError as error:
        raise InputError(
            wrong_entry(path, name, msgspec.toml.decode(text), kind, str(error))
        ) from error
    except (msgspec.DecodeError, RecursionError) as error:
        raise InputError(f"{path} is not a valid {name} ({error}); correct it.") from None
    except ValueError:  # of more digits than Python turns into an integer
        raise InputError(
            f"{path} is not a valid {name} (a number has thousands of digits); correct it."
        ) from None
    given = msgspec.to_builtins(found)
    for steps, value in _numbers(given):
        if not math.isfinite(value):
            raise InputError(
                f"{path}: {_entry(steps, given)} is {value}; it must be a finite number."
            )
    return found


# What msgspec expects, in words.
_WANTED = {
    "int": "a whole number", "float": "a number", "str": "a text in quotes",
    "bool": "true or false",
    "array": "a list in brackets", "object": "a table",
}  # fmt: skip


def wrong_entry(path: Path | str, name: str, given: Any, kind: type, fault: str) -> str:
    """What msgspec found wrong in a TOML file's values, as a sentence that names the entry."""
    what, _, at = fault.partition(" - at `$")
    steps = [step for step in re.findall(r"\.\.\.|\w+", at) if step]
    unknown = re.search(r"unknown field `([^`]+)`", what)
    if unknown:
        table = _entry(steps, given, table=True)
        known = list(_hints(kind, steps))
        near = difflib.get_close_matches(unknown[1], known, 1)
        meant = f"; entries of {'this table' if table else f'a {name}'} are {', '.join(known)}."
        meant = f'; "{near[0]}" may be meant.' if near else meant
        return f'{path}: {table + " has" if table else "there is"} no entry "{unknown[1]}"{meant}'
    missing = re.search(r"missing required field `([^`]+)`", what)
    if missing:
        return f"{path}: {_entry([*steps, missing[1]], given)} is missing; add it."
    if what.startswith("Invalid enum value") and (choices := _choices(kind, steps)):
        said = f"{', '.join(choices[:-1])} or {choices[-1]}"
        return f"{path}: {_entry(steps, given)} must be {said}, not {_given(given, steps)}."
    if re.match("Expected `(int|float)` [<>]", what):
        where, value = _entry(steps, given), _given(given, steps)
        endless = value.lstrip("-") in ("nan", "inf")
        must = "a finite number" if endless else _limits(kind, steps)
        return f"{path}: {where} is {value}; it must be {must}."
    wanted = re.fullmatch(r"Expected `([^`]+)`, got `[^`]+`", what)
    if not wanted or not steps:
        where = f"{_entry(steps, given)}: " if steps else ""
        return f"{path}: {where}{what[:1].lower()}{what[1:]}; correct it."
    kinds = [_WANTED.get(k.strip(), k.strip()) for k in wanted[1].split("|") if k.strip() != "null"]
    return (
        f"{path}: {_entry(steps, given)} must be {' or '.join(kinds)}, not {_given(given, steps)}."
    )


def _entry(steps: Sequence[str], given: Any, table: bool = False) -> str:
    """Where an entry, or a `table`, stands, as one would look for it: "[modes] count".

    Tables of a list with number and name, as they are `given` in the file.
    """
    names = [i for i, step in enumerate(steps) if not _is_place(step)]
    said = []
    for k, i in enumerate(names):
        place = steps[i + 1] if i + 1 < len(steps) and _is_place(steps[i + 1]) else ""
        if k + 1 < len(names) or table:
            number = f" number {int(place) + 1}" if place.isdecimal() else ""
            block = _at(given, steps[: i + 2]) if number else {}
            number += next((f" ({block[key]})" for key in NAMES if key in block), "")
            said.append(f"[[{steps[i]}]]{number}" if place else f"[{steps[i]}]")
        else:
            said.append(steps[i])
    return " ".join(said)


def _is_place(step: str) -> bool:
    """Whether a step is a place in a list, which msgspec does not always tell."""
    return step == "..." or step.isdecimal()


def _choices(kind: Any, steps: Sequence[str]) -> list[str]:
    """What an entry may be, where that is one of few."""
    choices = [part for part in _hint(kind, steps) if isinstance(part, str | int)]
    return [f'"{choice}"' if isinstance(choice, str) else str(choice) for choice in choices]


def _limits(kind: Any, steps: Sequence[str]) -> str:
    """What `limited` says of an entry."""
    of = next(part for part in _hint(kind, steps) if isinstance(part, msgspec.Meta))
    ends = (of.gt, "above"), (of.ge, "at least"), (of.lt, "below"), (of.le, "at most")
    unit = (of.extra or {})["unit"]
    return " and ".join(f"{word} {end:g}{unit}" for end, word in ends if end is not None)


def _hint(kind: Any, steps: Sequence[str]) -> list[Any]:
    """The type of an entry, and those that it is made of."""
    *table, last = (step for step in steps if not _is_place(step))
    return _parts(_hints(kind, table).get(last))


def _hints(kind: Any, steps: Sequence[str]) -> dict[str, Any]:
    """Types of the entries of a table by name, as far as they are known."""
    for step in (step for step in steps if not _is_place(step)):
        kind = next(
            filter(msgspec.inspect.is_struct_type, _parts(_hints(kind, ()).get(step))), None
        )
    known = msgspec.inspect.is_struct_type(kind)
    return typing.get_type_hints(kind, include_extras=True) if known else {}


def _parts(hint: Any) -> list[Any]:
    """A type and those that it is made of."""
    return [hint, *(inner for part in typing.get_args(hint) for inner in _parts(part))]


def _given(given: Any, steps: Sequence[str]) -> str:
    """The value at an entry as TOML writes it, short."""
    value = _at(given, steps)
    said = {True: "true", False: "false"}.get(value) if isinstance(value, bool) else None
    said = said or (f'"{value}"' if isinstance(value, str) else str(value))
    return said if len(said) <= LONGEST else f"{said[:LONGEST]}…"


def _at(value: Any, steps: Sequence[str]) -> Any:
    """What steps lead to in a file's values, as far as they lead."""
    for step in steps:
        try:
            value = value[int(step)] if isinstance(value, list | tuple) else value[step]
        except (LookupError, ValueError, TypeError):
            break
    return value


def _numbers(value: Any, steps: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], float]]:
    """Every float in builtin values, after the steps that lead to it."""
    if isinstance(value, float):
        yield steps, value
    elif isinstance(value, dict | list | tuple):
        pairs = value.items() if isinstance(value, dict) else enumerate(value)
        for step, item in pairs:
            yield from _numbers(item, (*steps, str(step)))
