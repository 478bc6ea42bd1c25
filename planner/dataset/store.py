"""Results kept on disk under a hash of all that they depend on: computed once, found again.

The store is shared by all commands and processes of a user. An entry is a checksum and what it
covers: the key and the result, pickled, so that it comes back bit by bit. One that is damaged, half
written or of another key is as good as none, and a store that cannot be written only costs time.
"""

import hashlib
import os
import pickle
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from planner import content_hash

MOST_BYTES = 768 * 1024 * 1024  # a thousand poses, fifty models; then those unused longest go
LEFT_SHARE = 0.8  # of MOST_BYTES that is left when some went, so that the next ones fit
LONGEST_UNUSED_S = 180 * 24 * 3600.0
WRITING_S = 3600.0  # a part older than this belongs to a process that was stopped
LOOK_EVERY = 64  # entries written by a process, after which it looks at the size again

T = TypeVar("T")


class Store:
    """A folder of results by key; `folder` None keeps nothing."""

    def __init__(self, folder: Path | None, most_bytes: int = MOST_BYTES):
        self.folder, self.most_bytes = folder, most_bytes
        self._written = 0

    def result(self, key: str, kind: type[T], make: Callable[[], T]) -> T:
        """What is kept under a key (hex), or else made now and kept.

        The key is a hash of all that the result depends on, the kind of result among it. What
        `make` raises is raised, and nothing is kept.
        """
        found = self.get(key, kind)
        if found is None:
            found = make()
            self.put(key, found)
        return found

    def get(self, key: str, kind: type[T]) -> T | None:
        """What is kept under a key; None where nothing is, or nothing whole."""
        if self.folder is None:
            return None
        path = self.folder / key
        try:
            data = path.read_bytes()
        except OSError:
            return None
        body = data[32:]
        if data[:32] != _checksum(key, body):
            return None
        try:
            found = pickle.loads(body)  # this user's own file, its checksum verified
        except Exception:  # whatever a library makes of it, it is made again
            return None
        with suppress(OSError):
            os.utime(path)  # entries in use are the last to go
        return found if isinstance(found, kind) else None

    def has(self, key: str) -> bool:
        """Whether there is an entry, whole or not."""
        return self.folder is not None and (self.folder / key).is_file()

    def put(self, key: str, result: Any) -> None:
        """Keep a result; another process sees all of it or nothing.

        One that a library cannot pickle only costs the time to make it again.
        """
        if self.folder is None:
            return
        try:
            body = pickle.dumps(result, pickle.HIGHEST_PROTOCOL)
        except (pickle.PicklingError, TypeError, AttributeError, RuntimeError):
            return
        part = None
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=self.folder, suffix=".part", delete=False) as file:
                part = Path(file.name)
                file.write(_checksum(key, body) + body)
            os.replace(part, self.folder / key)
            part = None
            if self._written % LOOK_EVERY == 0:
                self._thin_out(time.time())
            self._written += 1
        except OSError:
            pass
        finally:
            if part is not None:
                with suppress(OSError):
                    part.unlink()

    def _thin_out(self, now: float) -> None:
        """Remove entries that nobody used for long, and the oldest where there are too many."""
        assert self.folder is not None
        entries = []
        with os.scandir(self.folder) as found:  # thousands of entries: faster than by Path
            for entry in found:
                with suppress(OSError):
                    status = entry.stat()
                    entries.append((now - status.st_mtime, status.st_size, entry.path))
        total = sum(size for _, size, _ in entries)
        most = self.most_bytes if total <= self.most_bytes else LEFT_SHARE * self.most_bytes
        for age, size, path in sorted(entries, reverse=True):
            part = path.endswith(".part")
            if age > (WRITING_S if part else LONGEST_UNUSED_S) or (total > most and not part):
                with suppress(OSError):
                    os.unlink(path)
                total -= size


def user_store() -> Store:
    """The store of this user; one that keeps nothing where there is no home."""
    try:
        return _store_in(content_hash.cache_folder("results"))
    except RuntimeError:
        return Store(None)


@cache
def _store_in(folder: Path) -> Store:
    """One for all of the process: each new one looks through all entries at its first."""
    return Store(folder)


def _checksum(key: str, body: bytes) -> bytes:
    return hashlib.sha256(key.encode() + b"\n" + body).digest()
