"""FRFs of one file, or of a folder of files that hold some entries of the matrix each."""

from pathlib import Path

from planner.errors import InputError
from planner.recording.file_names import placed_by_name
from planner.recording.folder import files_in
from planner.recording.read import READERS, read
from planner.recording.records import FrfRecord


def read_frfs(path: Path, from_names: bool = False) -> tuple[FrfRecord, ...]:
    """FRFs of a file or folder; with `from_names` what they lack of places is in files' names.

    Raises InputError in one sentence, also where there are none.
    """
    files = files_in(path, READERS) if path.is_dir() else [path]
    found = [r for file in files for r in read(file) if isinstance(r, FrfRecord)]
    if not found:
        raise InputError(f"{path} holds no FRFs; export FRFs, or name hits to planner modes.")
    return tuple(placed_by_name(r, r.source.name) if from_names else r for r in found)
