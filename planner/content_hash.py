"""Hashes of all that a result depends on: the names under which results are kept."""

import hashlib
from functools import cache
from pathlib import Path

import msgspec


def digest(*parts: bytes | str) -> str:
    """SHA-256 of the parts, each with its length, so that no two lists of parts coincide."""
    whole = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        whole.update(len(data).to_bytes(8, "big") + data)
    return whole.hexdigest()


def of(value: object) -> bytes:
    """Canonical JSON of structs, dataclasses and builtins."""
    return msgspec.json.encode(value, order="deterministic")


@cache
def program(*packages: str) -> str:
    """Hash of this program's own text, or of some of its packages': another may compute otherwise.

    Args:
        packages: Names of folders in the program, such as "modal"; none for the whole program.
    """
    root = Path(__file__).parent
    files = sorted(p for p in root.rglob("*.py") if "campaigns" not in p.relative_to(root).parts)
    if packages:
        files = [p for p in files if p.relative_to(root).parts[0] in packages]
    return digest(*(p.relative_to(root).as_posix() + "\n" + p.read_text("utf-8") for p in files))
