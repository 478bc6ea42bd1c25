"""Files as they are now: read and hashed once for as long as nobody writes them."""

import hashlib
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Generic, TypeVar

Mark = tuple[int, ...]  # number on the disk, size, last write and change (ns)
T = TypeVar("T")


class LastRead(Generic[T]):
    """What was made of the files read last: of so many bytes, of the last one in any case."""

    def __init__(self, most_bytes: int = 64 << 20) -> None:
        self.most_bytes = most_bytes
        self._kept: OrderedDict[Path, tuple[Mark, T]] = OrderedDict()

    def of(self, path: Path, now: Mark, make: Callable[[Path], T]) -> T:
        """As it is remembered, or made anew of a file that has changed: its mark is `now`."""
        known = self._kept.pop(path, None)
        self._kept[path] = known if known and known[0] == now else (now, make(path))
        while len(self._kept) > 1 and sum(m[1] for m, _ in self._kept.values()) > self.most_bytes:
            self._kept.popitem(last=False)
        return self._kept[path][1]


_contents: LastRead[bytes] = LastRead()
_hashes: dict[Path, tuple[Mark, str]] = {}


def mark(path: Path) -> Mark:
    """What changes when a file is written. Raises OSError."""
    stat = path.stat()
    return stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns


def read(path: Path) -> bytes:
    """A file's bytes. Raises OSError."""
    return _contents.of(path, mark(path), Path.read_bytes)


def sha256(path: Path) -> str:
    """The hash of a file's bytes. Raises OSError."""
    now = mark(path)
    if path not in _hashes or _hashes[path][0] != now:
        _hashes[path] = now, hashlib.sha256(read(path)).hexdigest()
    return _hashes[path][1]


def remember(path: Path, now: Mark, digest: str) -> None:
    """A hash that was worked out before, when the file's mark was `now`."""
    _hashes.setdefault(path, (now, digest))
