"""The folder into which the analyser exports: files that are whole and new, and their tables."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from planner.campaign.store import recording_hash
from planner.errors import ForeignFileError, InputError, PlannerError
from planner.recording.folder import TABLE, TABLES, read_recordings
from planner.recording.joints import JointUnits
from planner.recording.points import PointNames
from planner.recording.read import READERS, read, version
from planner.recording.records import PoseRow

TEXT, TEXT_LONGER = (".csv", ".tsv", ".txt"), 3.0
SETTLED = 8.0  # times `quiet_s`: what does not read until then is not being written any more
OLD_S = 60.0  # what was changed last so long ago is not being written either; chosen
WRITING = "is still being written"


@dataclass(frozen=True)
class Content:
    """What a file holds: its hash, why it does not read to its end, and whether it is foreign."""

    digest: str = ""
    fault: str = ""
    foreign: bool = False


@dataclass
class Inbox:
    """Watches a folder. A file is whole when its size has stood still and it reads to its end.

    Files are known by content: what was imported or set aside is never offered again, whatever
    it is called and however often the session is started. What does not read is being written
    until it has stood still for longer; `unfit` says why no hit can be made of a file that reads.
    """

    folder: Path
    quiet_s: float = 0.6
    unfit: Callable[[Path], str] = lambda path: ""
    _seen: dict[Path, tuple[int, float, float]] = field(default_factory=dict)
    _contents: dict[Path, tuple[tuple[int, ...], Content]] = field(default_factory=dict)
    _ignored: set[Path] = field(default_factory=set)

    def scan(self, done: Callable[[Path, str], bool]) -> tuple[list[Path], list[tuple[Path, str]]]:
        """Whole new files, oldest first, and those not whole yet, with what is the matter.

        Files of which `done` says so, by their hash, are left out.
        """
        whole, waiting = [], []
        for path in self._candidates():
            try:
                stat, mark = path.stat(), version(path)
            except OSError:
                continue
            if not self._still(path, stat.st_size, stat.st_mtime):
                waiting += [] if _old(stat.st_mtime) else [(path, WRITING)]
                continue
            found = self._content(path, mark)
            settled = self._settled(path)
            if found.digest and done(path, found.digest):
                continue
            if not settled and (found.fault or self.unfit(path)):
                waiting.append((path, WRITING))
            elif found.fault and not found.foreign:
                waiting.append((path, found.fault))
            elif not found.fault:
                whole.append(path)
        return whole, waiting

    def present(self) -> list[str]:
        """Content hashes of all files that can be read, whole or not yet."""
        return [digest for path in self._candidates() if (digest := self.digest(path))]

    def ignored(self) -> list[Path]:
        """Files that are no recordings, each once."""
        found = [
            path for path, (_, content) in self._contents.items()
            if content.foreign and path not in self._ignored
            and self._settled(path)
        ]  # fmt: skip
        self._ignored.update(found)
        return found

    def _candidates(self) -> list[Path]:
        found = [
            p for p in self.folder.rglob("*")
            if p.is_file() and p.name not in TABLES and p.suffix.lower() in READERS
            and not p.name.startswith(".")
        ]  # fmt: skip
        return sorted(found, key=lambda p: (p.stat().st_mtime, p.name))

    def _quiet(self, path: Path) -> float:
        """For how long (s) a file has stood still."""
        return time.monotonic() - self._seen[path][2]

    def _settled(self, path: Path) -> bool:
        """Whether a file is surely not being written any more."""
        return self._quiet(path) >= SETTLED * self.quiet_s or _old(self._seen[path][1])

    def _still(self, path: Path, size: int, modified: float) -> bool:
        known = self._seen.get(path)
        if known is None or known[:2] != (size, modified):
            self._seen[path] = (size, modified, time.monotonic())
            return self.quiet_s <= 0
        # A text table that is cut off between two rows reads to its end: it gets more time.
        longer = TEXT_LONGER if path.suffix.lower() in TEXT else 1.0
        return self._quiet(path) >= longer * self.quiet_s

    def _content(self, path: Path, mark: tuple[int, ...]) -> Content:
        """What a file holds, read anew where it changed."""
        known = self._contents.get(path)
        if known is not None and known[0] == mark:
            return known[1]
        try:
            digest = recording_hash(path)
            read(path)
            found = Content(digest)
        except PlannerError as error:
            found = Content(fault=str(error), foreign=isinstance(error, ForeignFileError))
        self._contents[path] = (mark, found)
        return found

    def digest(self, path: Path) -> str:
        """Content hash of a whole file; "" where it cannot be read."""
        try:
            return self._content(path, version(path)).digest
        except OSError:  # it was taken away meanwhile
            return ""


def _old(modified: float) -> bool:
    return time.time() - modified > OLD_S


Stamp = tuple[int, int]  # size and time of a table


@dataclass
class FolderTable:
    """The tables of a folder and of those in it.

    `check` raises InputError where the robot cannot stand as a row, which it is told, says.
    """

    folder: Path
    joints: JointUnits
    points: PointNames
    check: Callable[[tuple[float, ...], str], object]
    waiting: list[tuple[Path, str]] = field(default_factory=list)  # wrong ones, and why
    _stamps: dict[Path, Stamp] = field(default_factory=dict)
    _rows: dict[Path, tuple[Path, PoseRow]] = field(default_factory=dict)

    def listed(self, path: Path) -> tuple[Path | None, PoseRow | None]:
        """The folder whose table lists a file, and what it says of it; None: none does."""
        return self._rows.get(path.resolve(), (None, None)) if self._rows else (None, None)

    def row(self, path: Path) -> PoseRow | None:
        """What a table says of a file; None: nothing."""
        return self.listed(path)[1]

    def follow(self) -> set[Path]:
        """Read what has changed; once a look at the folder, as tables lie anywhere in it.

        The tables that were wrong before and are right now.
        """
        stamps = dict(filter(None, map(_stamped, sorted(self.folder.rglob(TABLE)))))
        if stamps == self._stamps and not self.waiting:  # a file that was missing may have come
            return set()
        wrong = {path for path, _ in self.waiting}
        self._stamps, self._rows, self.waiting = stamps, {}, []
        for path in stamps:
            try:
                rows = read_recordings(path.parent, self.joints, self.points, bare=True)
                self._rows |= {row.file: (path.parent, row) for row in rows}
                for row in {row.pose: row for row in reversed(rows) if row.joints_deg}.values():
                    self.check(row.joints_deg, f"{path}, row {row.row}")
            except InputError as error:
                self.waiting.append((path, str(error)))
        return {path for path in wrong if path in stamps} - {path for path, _ in self.waiting}


def _stamped(path: Path) -> tuple[Path, Stamp] | None:
    try:
        stat = path.stat()
    except OSError:  # it was taken away meanwhile
        return None
    return path, (stat.st_size, stat.st_mtime_ns)
