"""Hashes of all that a result depends on: the names under which results are kept; and where."""

import hashlib
from functools import cache
from importlib.metadata import version
from pathlib import Path

import msgspec
import platformdirs


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
    texts = _texts()
    if packages:
        texts = {name: text for name, text in texts.items() if name.split("/")[0] in packages}
    return digest(*(f"{name}\n{text}" for name, text in texts.items()))


@cache
def libraries(*names: str) -> str:
    """Versions of installed libraries."""
    return ",".join(version(name) for name in names)


@cache
def _texts() -> dict[str, str]:
    """Text of every module of this program by its path inside it, in order."""
    root = Path(__file__).parent
    files = {p.relative_to(root).as_posix(): p for p in root.rglob("*.py")}
    own = sorted(name for name in files if "campaigns" not in name.split("/"))
    return {name: files[name].read_text("utf-8") for name in own}


def cache_folder(name: str) -> Path:
    """The user's folder for a kind of cache; RuntimeError for a user without a home."""
    path = platformdirs.user_cache_path("planner", appauthor=False)
    if not path.is_absolute():
        raise RuntimeError("There is no home folder.")
    return path / name
