"""What recordings.csv says of files, in the watched folder and those in it, read anew on change."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from planner.errors import InputError
from planner.recording.folder import TABLE, read_recordings
from planner.recording.joints import JointUnits
from planner.recording.points import PointNames
from planner.recording.records import PoseRow

Stamp = tuple[int, int]  # size and time of a table


@dataclass
class FolderTable:
    """The tables of a folder and of those in it. Without `joints` nothing is looked up.

    `check` raises InputError where the robot cannot stand as a row, which it is told, says.
    """

    folder: Path | None = None
    joints: JointUnits | None = None
    points: PointNames = field(default_factory=PointNames)
    check: Callable[[tuple[float, ...], str], object] = lambda joints_deg, where: None
    waiting: list[tuple[Path, str]] = field(default_factory=list)  # wrong ones, and why
    _stamps: dict[Path, Stamp] = field(default_factory=dict)
    _rows: dict[Path, tuple[Path, PoseRow]] = field(default_factory=dict)

    def row(self, path: Path) -> PoseRow | None:
        """What a table says of a file; None: nothing."""
        found = self._rows.get(path.resolve()) if self._rows else None
        return found[1] if found else None

    def listing(self, path: Path) -> Path | None:
        """The folder whose table lists a file; None: none does."""
        found = self._rows.get(path.resolve()) if self._rows else None
        return found[0] if found else None

    def follow(self) -> set[Path]:
        """Read what has changed; once a look at the folder, as tables lie anywhere in it.

        The tables that were wrong before and are right now.
        """
        if self.folder is None or self.joints is None:
            return set()
        stamps = dict(filter(None, map(_stamped, sorted(self.folder.rglob(TABLE)))))
        if stamps == self._stamps and not self.waiting:  # a file that was missing may have come
            return set()
        wrong = {path for path, _ in self.waiting}
        self._stamps, self._rows, self.waiting = stamps, {}, []
        for path in stamps:
            try:
                rows = read_recordings(path.parent, self.joints, self.points, bare=True).rows
                self._rows |= {row.file: (path.parent, row) for row in rows if row.file is not None}
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
