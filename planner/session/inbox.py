"""The folder into which the analyser exports: which files are there, whole, and new."""

import time
from dataclasses import dataclass, field
from pathlib import Path

from planner.campaign.store import read_bytes, sha256
from planner.errors import PlannerError
from planner.recording.folder import TABLE
from planner.recording.read import READERS, read

TEXT, TEXT_LONGER = (".csv", ".tsv", ".txt"), 3.0


@dataclass
class Inbox:
    """Watches a folder. A file is whole when its size has stood still and it reads to its end.

    Files are known by content: what was imported or set aside is never offered again, whatever
    it is called and however often the session is started.
    """

    folder: Path
    quiet_s: float = 0.6
    _seen: dict[Path, tuple[int, float, float]] = field(default_factory=dict)
    _digests: dict[Path, tuple[tuple[int, float], str, str]] = field(default_factory=dict)

    def scan(self, done: set[str]) -> tuple[list[Path], list[tuple[Path, str]]]:
        """Whole new files, oldest first, and those not whole yet, with what is the matter."""
        whole, waiting = [], []
        for path in self._candidates():
            try:
                stat = path.stat()
            except OSError:
                continue
            if not self._still(path, stat.st_size, stat.st_mtime):
                waiting.append((path, "is being written"))
                continue
            digest, fault = self._content(path, stat.st_size, stat.st_mtime)
            if digest in done:
                continue
            if fault:
                waiting.append((path, fault))
            else:
                whole.append(path)
        return whole, waiting

    def _candidates(self) -> list[Path]:
        found = [
            p for p in self.folder.rglob("*")
            if p.is_file() and p.name != TABLE and p.suffix.lower() in READERS
            and not p.name.startswith(".")
        ]  # fmt: skip
        return sorted(found, key=lambda p: (p.stat().st_mtime, p.name))

    def _still(self, path: Path, size: int, modified: float) -> bool:
        known = self._seen.get(path)
        if known is None or known[:2] != (size, modified):
            self._seen[path] = (size, modified, time.monotonic())
            return self.quiet_s <= 0
        # A text table that is cut off between two rows reads to its end: it gets more time.
        longer = TEXT_LONGER if path.suffix.lower() in TEXT else 1.0
        return time.monotonic() - known[2] >= longer * self.quiet_s

    def _content(self, path: Path, size: int, modified: float) -> tuple[str, str]:
        """Content hash and, if the file does not read to its end, why."""
        known = self._digests.get(path)
        if known is not None and known[0] == (size, modified):
            return known[1], known[2]
        fault = ""
        try:
            digest = sha256(read_bytes(path))
            read(path)
        except PlannerError as error:
            digest, fault = "", str(error)
        self._digests[path] = ((size, modified), digest, fault)
        return digest, fault

    def digest(self, path: Path) -> str:
        """Content hash of a whole file."""
        return sha256(read_bytes(path))
