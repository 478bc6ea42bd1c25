"""Files as they are now: read and hashed once for as long as nobody writes them."""

import hashlib
from collections import OrderedDict
from pathlib import Path

Mark = tuple[int, int, int, int]  # number on the disk, size, last write and change (ns)

MOST_BYTES = 64 * 1024 * 1024  # of contents that are remembered; the last one in any case
_contents: OrderedDict[Path, tuple[Mark, bytes]] = OrderedDict()
_hashes: dict[Path, tuple[Mark, str]] = {}


def mark(path: Path) -> Mark:
    """What changes when a file is written. Raises OSError."""
    stat = path.stat()
    return stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns


def read(path: Path) -> bytes:
    """A file's bytes. Raises OSError."""
    now = mark(path)
    known = _contents.pop(path, None)
    data = known[1] if known and known[0] == now else path.read_bytes()
    _contents[path] = now, data
    while len(_contents) > 1 and sum(len(d) for _, d in _contents.values()) > MOST_BYTES:
        _contents.popitem(last=False)
    return data


def sha256(path: Path) -> str:
    """The hash of a file's bytes. Raises OSError."""
    now = mark(path)
    if path not in _hashes or _hashes[path][0] != now:
        _hashes[path] = now, hashlib.sha256(read(path)).hexdigest()
    return _hashes[path][1]


def remember(path: Path, now: Mark, digest: str) -> None:
    """A hash that was worked out before, when the file's mark was `now`."""
    _hashes.setdefault(path, (now, digest))
