"""Results kept as JSON beside their checksum: a file that was damaged is told from a whole one."""

import hashlib
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from planner.campaign.journal import write_synced

T = TypeVar("T")


class _Checked(msgspec.Struct):
    check: str
    kept: msgspec.Raw


def write_checked(path: Path, value: Any) -> None:
    """Keep what msgspec can encode; the file is whole under its name, or absent."""
    body = msgspec.json.encode(value)
    check = hashlib.sha256(body).hexdigest()
    write_synced(path, b'{"check":"%s","kept":%s}' % (check.encode(), body))


def read_checked(path: Path, kind: type[T]) -> T | None:
    """What was kept; None where nothing was, or where it is damaged (then the file exists)."""
    try:
        found = msgspec.json.decode(path.read_bytes(), type=_Checked)
        if hashlib.sha256(bytes(found.kept)).hexdigest() != found.check:
            return None
        return msgspec.json.decode(found.kept, type=kind)
    except (OSError, UnicodeDecodeError, msgspec.DecodeError):
        return None
