"""What recordings.csv in the watched folder says of files, read anew whenever it changes."""

from dataclasses import dataclass, field
from pathlib import Path

from planner.errors import InputError
from planner.recording.folder import TABLE, read_recordings
from planner.recording.joints import JointUnits
from planner.recording.points import PointNames
from planner.recording.records import PoseRow

Stamp = tuple[int, int] | None  # size and time of the table; None: there is none


@dataclass
class FolderTable:
    """The table of a folder, if it has one. Without `joints` nothing is looked up."""

    folder: Path | None = None
    joints: JointUnits | None = None
    points: PointNames = field(default_factory=PointNames)
    _stamp: Stamp = None
    _rows: dict[Path, PoseRow] = field(default_factory=dict)
    _fault: str = ""

    def row(self, path: Path) -> PoseRow | None:
        """What the table says of a file; None: nothing."""
        self._follow()
        return self._rows.get(path.resolve()) if self._rows else None

    @property
    def waiting(self) -> list[tuple[Path, str]]:
        """The table itself, where it cannot be read, with what is the matter."""
        self._follow()
        return [(self.folder / TABLE, self._fault)] if self.folder and self._fault else []

    def _follow(self) -> None:
        if self.folder is None or self.joints is None:
            return
        stamp = self._now(self.folder / TABLE)
        if stamp == self._stamp and not self._fault:  # a file that was missing may have come
            return
        self._stamp, self._rows, self._fault = stamp, {}, ""
        if stamp is None:
            return
        try:
            rows = read_recordings(self.folder, self.joints, self.points).rows
            self._rows = {row.file: row for row in rows if row.file is not None}
        except InputError as error:
            self._fault = str(error)

    def _now(self, path: Path) -> Stamp:
        try:
            stat = path.stat()
        except OSError:
            return None
        return stat.st_size, stat.st_mtime_ns
