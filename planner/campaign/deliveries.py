"""What the user names on the command line, sorted into poses with their files."""

from dataclasses import dataclass, replace
from pathlib import Path

from planner.dataset.screened_files import Source
from planner.dataset.visits import table_folders
from planner.errors import InputError
from planner.recording.folder import CHANNELS, TABLE, files_in, read_recordings
from planner.recording.joints import JointUnits
from planner.recording.points import PointNames, StatedPoints
from planner.recording.read import READERS
from planner.recording.records import PoseRow


@dataclass(frozen=True)
class Delivery:
    """Files of one pose; `joints_deg` is the readback, None where no table states it.

    `said`: somebody stated the pose, a table of recordings (it names its `row`) or who imports.
    """

    pose: str
    joints_deg: tuple[float, ...] | None
    sources: tuple[Source, ...]
    row: str = ""  # "file, row n" for messages
    said: bool = True


def sort_paths(
    paths: tuple[Path, ...],
    joints: JointUnits,
    points: PointNames,
    pose: str | None,
    default_pose: str | None,
) -> tuple[Delivery, ...]:
    """Deliveries by pose, in recording order.

    A folder with recordings.csv says itself which pose a file belongs to (`pose` then picks one,
    or renames the only one), and so do its subfolders; bare files belong to `pose` or, without it,
    to `default_pose`, "" where there is none. A table without joints is one of proposed poses.
    """
    deliveries: list[Delivery] = []
    bare: list[Path] = []
    for path in paths:
        if path.exists() and (folders := table_folders(path)):
            deliveries += _from_tables(path, folders, joints, points, pose)
        elif path.is_dir():
            bare += files_in(path, READERS)
        elif path.is_file():
            bare += [path] if path.name != CHANNELS else []
        else:
            raise InputError(f"{path} does not exist; name recordings or a recordings folder.")
    if bare:
        stated = StatedPoints() if points == PointNames() else StatedPoints(names=points)
        sources = tuple(Source(path, str(path), stated=stated) for path in bare)
        name = pose or default_pose or ""
        deliveries.append(Delivery(name, None, sources, said=pose is not None))
    return tuple(deliveries)


def _from_tables(
    path: Path,
    folders: tuple[Path, ...],
    joints: JointUnits,
    points: PointNames,
    pose: str | None,
) -> list[Delivery]:
    """Deliveries of folders, each with a table of its own; `pose` picks one, or renames the only.

    Raises InputError where there is none of that name.
    """
    every = [d for folder in folders for d in _from_table(folder, joints, points)]
    found = [d for d in every if pose in (None, d.pose)]
    if pose is not None and not found and len(folders) == len(every) == 1:
        found = [replace(every[0], pose=pose)]
    if not found:
        names = list(dict.fromkeys(d.pose for d in every))
        where = folders[0] / TABLE if len(folders) == 1 else path
        raise InputError(f"{where} has no pose {pose}; its poses are {', '.join(names[:8])}.")
    return found


def _from_table(folder: Path, joints: JointUnits, points: PointNames) -> list[Delivery]:
    rows: dict[str, list[PoseRow]] = {}
    for row in read_recordings(folder, joints, points, bare=True):
        rows.setdefault(row.pose, []).append(row)
    return [
        Delivery(
            name,
            group[0].joints_deg or None,
            tuple(Source.of(r) for r in group if r.file),
            f"{folder / TABLE}, row {group[0].row}",
        )
        for name, group in rows.items()
    ]
