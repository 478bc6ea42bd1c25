"""TOML files as typed values, every fault in one sentence."""

import math
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from planner.errors import InputError

T = TypeVar("T")


def read_toml_text(path: Path, name: str) -> str:
    """Text of a TOML file, without a byte order mark; InputError naming file and remedy."""
    try:
        return path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{path} does not exist; name a {name}.") from None
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
    except (msgspec.DecodeError, RecursionError) as error:
        raise InputError(f"{path} is not a valid {name} ({error}); correct it.") from None
    except ValueError:  # of more digits than Python turns into an integer
        raise InputError(
            f"{path} is not a valid {name} (a number has thousands of digits); correct it."
        ) from None
    entry, value = _not_finite(msgspec.to_builtins(found), "")
    if entry:
        raise InputError(f"{path}: {entry} is {value}; it must be a finite number.")
    return found


def _not_finite(value: Any, name: str) -> tuple[str, float]:
    """The first nan or inf below an entry, which no entry of ours may be, and its name."""
    if isinstance(value, float):
        return ("", 0.0) if math.isfinite(value) else (name, value)
    pairs: list[tuple[str, Any]] = []
    if isinstance(value, dict):
        for key, item in value.items():
            if isinstance(item, dict):
                pairs.append((f"{name} [{key}]".strip(), item))
            elif isinstance(item, list | tuple) and item and isinstance(item[0], dict):
                numbered = enumerate(item, 1)
                pairs += [(f"{name} [[{key}]] number {i}".strip(), one) for i, one in numbered]
            else:
                pairs.append((f"{name} {key}".strip(), item))
    elif isinstance(value, list | tuple):
        pairs = [(name, item) for item in value]
    for inner, item in pairs:
        entry, number = _not_finite(item, inner)
        if entry:
            return entry, number
    return "", 0.0
