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
        raw = msgspec.toml.decode(text)
        if (where := _not_finite(raw)) is not None:
            raise InputError(f"{path}: {where} is no finite number; give one.")
        return msgspec.convert(raw, type=kind)
    except (msgspec.DecodeError, RecursionError, ValueError) as error:
        raise InputError(f"{path} is not a valid {name} ({error}); correct it.") from None


def _not_finite(value: Any, where: str = "") -> str | None:
    """Where the first nan or inf stands, as `stop.probability`; None: nowhere."""
    if isinstance(value, dict):
        parts = [(f"{where}.{key}" if where else key, v) for key, v in value.items()]
    elif isinstance(value, list):
        parts = [(f"{where}[{number}]", v) for number, v in enumerate(value, 1)]
    else:
        finite = not isinstance(value, float) or math.isfinite(value)
        return None if finite else where
    return next((found for name, v in parts if (found := _not_finite(v, name))), None)
