"""FRFs of files, and where each was felt and hit as its name says, for those who ask for it.

"anything_yx" is the response along y to a hit along x, "H3_1" or "H31" the response at node 3 to a
hit at node 1, "3y_1x" both; signs may stand before an axis.
"""

import re
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from planner.errors import InputError
from planner.recording.column_names import hit_direction
from planner.recording.folder import files_in
from planner.recording.read import READERS, read
from planner.recording.records import FrfRecord

_AXES = re.compile(r"(?:^|[^a-z])([+-]?[xyz])_?([+-]?[xyz])$", re.IGNORECASE)
_NODES = re.compile(r"(?:^|[^a-z0-9])h?(\d+)([+-]?[xyz]?)[_,-](\d+)([+-]?[xyz]?)$", re.IGNORECASE)
_DIGITS = re.compile(r"(?:^|[^a-z0-9])h(\d)(\d)$", re.IGNORECASE)


class Place(NamedTuple):
    """Nodes ("" unknown) and signed axes ("" unknown) of the response and of the hit."""

    response_node: str
    response: str
    hit_node: str
    hit: str


def place_in_name(path: Path) -> Place:
    """What a file's name says. Raises InputError where it says nothing."""
    stem = path.name.removesuffix(".gz").rpartition(".")[0]
    if found := _NODES.search(stem):
        return Place(found[1], found[2], found[3], found[4])
    if found := _DIGITS.search(stem):
        return Place(found[1], "", found[2], "")
    if found := _AXES.search(stem):
        return Place("", found[1], "", found[2])
    raise InputError(
        f"{path}: its name says neither axes nor nodes; call it such as tap_yx (response y, hit "
        f"x), H3_1 or 3y_1x (nodes), or leave out --from-names."
    )


def placed_by_name(record: FrfRecord, name: str) -> FrfRecord:
    """FRFs with what they do not state themselves from their file's name; of several the hit."""
    place, count = place_in_name(Path(name)), len(record.values)
    response, reference = hit_direction(place.response), hit_direction(place.hit)
    alone = count == 1
    return replace(
        record,
        response_direction=tuple(d or alone * response for d in record.response_direction),
        reference_direction=tuple(d or reference for d in record.reference_direction),
        response_node=_nodes(record.response_node, place.response_node if alone else "", count),
        reference_node=_nodes(record.reference_node, place.hit_node, count),
    )


def _nodes(own: tuple[str, ...], named: str, count: int) -> tuple[str, ...]:
    return tuple(named if node in ("", "0") else node for node in own or ("",) * count)


def read_frfs(path: Path, from_names: bool = False) -> tuple[FrfRecord, ...]:
    """FRFs of a file or folder; with `from_names` what they lack of places is in files' names.

    Raises InputError in one sentence, also where there are none.
    """
    files = files_in(path, READERS) if path.is_dir() else [path]
    found = [r for file in files for r in read(file) if isinstance(r, FrfRecord)]
    if not found:
        raise InputError(f"{path} holds no FRFs; export FRFs, or name hits to planner modes.")
    return tuple(placed_by_name(r, r.source.name) if from_names else r for r in found)
