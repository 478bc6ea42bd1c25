"""TOML files as typed values, every fault in one sentence."""

from pathlib import Path
from typing import TypeVar

import msgspec

from planner.errors import InputError

T = TypeVar("T")


def load_toml(path: Path, kind: type[T], name: str) -> T:
    """Decode a TOML file; InputError naming the file, the fault and the remedy."""
    try:
        return msgspec.toml.decode(path.read_bytes(), type=kind)
    except FileNotFoundError:
        raise InputError(f"{path} does not exist; name a {name}.") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); name a file.") from None
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is not a valid {name} ({error}); correct it.") from None
