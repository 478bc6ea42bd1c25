"""Files by pose and by visit: where a recording was made, and which of them belong together."""

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from planner.dataset.measure import MeasuredPose
from planner.dataset.screened_files import Source
from planner.errors import InputError
from planner.recording.folder import TABLE, TABLES, read_recordings, shown
from planner.recording.joints import JointUnits
from planner.recording.points import PointNames
from planner.recording.read import READERS, read
from planner.recording.records import Hit

NAMED = 3  # folders in a sentence, and files of each that are looked into


@dataclass(frozen=True, eq=False)
class Visit:
    """Hits at one pose without leaving it: q (dof,) in rad, `order` 0 to 1 through the campaign.

    Its hits are good by themselves. Some may disagree with their repeats: that is what screens
    look for.
    """

    pose: str
    q: np.ndarray
    order: float
    hits: tuple[Hit, ...]


class Recording(NamedTuple):
    """One file: the pose at which it was recorded, its readback q (dof,) in rad, where it lies."""

    pose: str
    q: np.ndarray
    source: Source


@dataclass(frozen=True, eq=False)
class PoseEntry:
    """What has an FRF of its own: as a rule a pose with all its visits; q (dof,) in rad."""

    pose: str
    q: np.ndarray
    measured: MeasuredPose


def table_folders(path: Path) -> tuple[Path, ...]:
    """Folders with a recordings.csv: of a table its own, a folder itself, or its subfolders.

    P2 comes before P10. None where there is no table; hidden folders are passed over.
    """
    if path.name == TABLE or (path / TABLE).is_file():
        return (path.parent if path.name == TABLE else path,)
    found = (table.parent for table in path.rglob(TABLE) if shown(table, path))

    def numbered(folder: Path) -> list[tuple[str, int]]:
        parts = re.findall(r"(\D*)(\d*)", folder.relative_to(path).as_posix())
        return [(text, int(digits or 0)) for text, digits in parts]

    return tuple(sorted(found, key=numbered))


def recordings_in(
    path: Path, joints: JointUnits, points: PointNames | None = None
) -> tuple[Recording, ...]:
    """Every file that the tables at a path list, in the order of recording.

    `path` is a folder with recordings.csv, the table itself, or a folder whose subfolders have one
    each, whose order is then that of their names.
    Raises InputError where there is no table, one is wrong, or two differ on where a pose was.
    """
    folders = table_folders(path) if path.exists() else (path,)
    if not folders:
        raise InputError(
            f"{path} has no {TABLE}, nor has a folder in it; add one that says of each file at "
            f"which pose it was recorded and how the joints stood, or name the campaign that "
            f"imported them."
        )
    found: list[Recording] = []
    first: dict[str, tuple[Path, tuple[float, ...]]] = {}
    for folder in folders:
        for row in read_recordings(folder, joints, points):
            where, stood = first.setdefault(row.pose, (folder / TABLE, row.joints_deg))
            if off := joints.apart(stood, row.joints_deg):
                raise InputError(
                    f"{folder / TABLE}, row {row.row}: pose {row.pose} has a joint {off} away from "
                    f"where {where} has it; give another pose another name."
                )
            q = joints.internal(row.joints_deg)
            found.append(Recording(row.pose, q, Source.of(row)))
    return tuple(found)


def unlisted_folders(path: Path, listed: Sequence[Recording]) -> tuple[str, ...]:
    """A sentence that names folders at a path with recordings of which no table names any.

    `listed` are all recordings that tables name. Files were imported with `--pose`, say: where the
    joints stood only the campaign knows then. None where every folder is used.
    """
    top = path.resolve()
    top = top.parent if top.name == TABLE else top
    used = {one.source.path.resolve().parent for one in listed}
    used |= {folder.resolve() for folder in table_folders(path)}
    found = sorted({file.parent for file in top.rglob("*") if _may_be_read(file, top)} - used)
    left = [folder for folder in found if _has_recordings(folder)]
    if not left:
        return ()
    names = ", ".join(folder.relative_to(top).as_posix() for folder in left[:NAMED])
    more = f" and {len(left) - NAMED} more" if len(left) > NAMED else ""
    return (
        f"Of {path}, {names}{more} {'is' if len(left) == 1 else 'are'} left out: no {TABLE} says "
        f"at which pose these files were recorded and how the joints stood. Add one, or, where "
        f"they were imported with --pose, name the campaign instead of {path.name}.",
    )


def _may_be_read(file: Path, top: Path) -> bool:
    """Whether a file below a folder is shown and has a format of recordings."""
    known = file.suffix.lower() in READERS and file.name not in TABLES
    return known and shown(file, top) and file.is_file()


def _has_recordings(folder: Path) -> bool:
    """Whether one of its first files can be read: pictures' tables and notes cannot."""
    files = sorted(file for file in folder.iterdir() if _may_be_read(file, folder))
    for file in files[:NAMED]:
        with suppress(InputError):
            read(file)
            return True
    return False
